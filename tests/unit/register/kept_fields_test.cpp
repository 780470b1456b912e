// SPDX-License-Identifier: Apache-2.0
#include "register/kept_fields.h"

#include <vector>

#include <gtest/gtest.h>

namespace af::registration {
namespace {

StudyCase case_of(const std::vector<std::string>& fields) {
  StudyCase study_case;
  for (const std::string& field : fields) {
    StudyView view;
    view.field = field;
    study_case.views.push_back(view);
  }
  return study_case;
}

/// Stands for an open field. The tests count its users and never look into it.
std::shared_ptr<const OpenedField> some_field() {
  const auto owner = std::make_shared<int>();
  return {owner, reinterpret_cast<const OpenedField*>(owner.get())};
}

TEST(KeptFields, AreThoseOfTheCaseAtHandThatALaterOneUses) {
  const std::vector<StudyCase> cases = {
      case_of({"a", "b"}), case_of({"a", "c"}), case_of({"c", "c"}), case_of({"a"})};
  KeptFields kept(cases);
  kept.begin_case(cases[0]);
  EXPECT_EQ(kept.find("a"), nullptr);
  const std::shared_ptr<const OpenedField> a = some_field();
  std::weak_ptr<const OpenedField> b;
  kept.add("a", a);
  {
    const std::shared_ptr<const OpenedField> field = some_field();
    b = field;
    kept.add("b", field);
  }
  EXPECT_TRUE(b.expired());  // no later case uses it
  kept.begin_case(cases[1]);
  EXPECT_EQ(kept.find("a"), a);
  kept.add("a", a);
  const std::shared_ptr<const OpenedField> c = some_field();
  kept.add("c", c);
  kept.begin_case(cases[2]);
  EXPECT_EQ(kept.find("a"), nullptr);  // a later case does, but this one does not
  EXPECT_EQ(kept.find("c"), c);
  kept.add("c", kept.find("c"));
  EXPECT_EQ(kept.find("c"), nullptr);  // the last that uses it
  EXPECT_EQ(c.use_count(), 1);
  EXPECT_EQ(a.use_count(), 1);
  kept.begin_case(cases[3]);
  EXPECT_EQ(kept.find("a"), nullptr);
}

}  // namespace
}  // namespace af::registration
