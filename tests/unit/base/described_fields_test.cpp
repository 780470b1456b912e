// SPDX-License-Identifier: Apache-2.0
#include "base/described_fields.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace af {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

struct Part {
  double step_mm = 1.0;

  void describe(Fields& field) { field("step_mm", step_mm, "Step").above(0.0).at_most(2.0); }
};

struct Whole {
  int nodes = 64;
  std::optional<double> share;
  std::vector<std::string> names = {"a"};
  Part part;
  bool is_internal = false;

  void describe(Fields& field) {
    field("nodes", nodes, "Nodes").within(2, 4096);
    field("share", share, "Share").finite().at_least(0.0);
    field("names", names, "Names").one_of({"a", "b", "c"});
    field.part(part);
    field.leave_out(is_internal, "set by the program");
  }
};

struct Forgetful {
  int nodes = 64;
  int forgotten = 1;

  void describe(Fields& field) { field("nodes", nodes, "Nodes"); }
};

struct Derived : Whole {
  std::string name = "x";

  void describe(Fields& field) {
    field.part<Whole>(*this);
    field("name", name, "Name");
  }
};

TEST(DescribedFields, AMemberThatIsForgottenIsFoundByTheFirstUse) {
  Forgetful forgetful;
  EXPECT_THROW(fields_of(forgetful), std::logic_error);
}

TEST(DescribedFields, OfPartsAndBasesAreListedInPlace) {
  Derived derived;
  std::vector<std::string> names;
  for (const Field& field : fields_of(derived)) names.push_back(field.name);
  EXPECT_THAT(names, ElementsAre("nodes", "share", "names", "step_mm", "name"));
}

TEST(DescribedFields, PointIntoTheStruct) {
  Derived derived;
  for (const Field& field : fields_of(derived))
    if (field.name == "step_mm") *std::get<double*>(field.value) = 1.5;
  EXPECT_EQ(derived.part.step_mm, 1.5);
}

TEST(FieldProblems, NameFieldValueAndConstraint) {
  Whole whole;
  EXPECT_THAT(field_problems(whole), IsEmpty());
  whole.nodes = 1;
  whole.share = std::numeric_limits<double>::quiet_NaN();
  whole.names = {"b", "d", ""};
  whole.part.step_mm = -0.5;
  EXPECT_THAT(field_problems(whole),
              ElementsAre("nodes = 1: must be between 2 and 4096",
                          "share = nan: must be finite and at least 0",
                          "names = d: must be a, b or c",
                          "names = '': must be a, b or c",
                          "step_mm = -0.5: must be above 0 and at most 2"));
}

}  // namespace
}  // namespace af
