// SPDX-License-Identifier: Apache-2.0
// A study of any content, whose files do not exist.
#include <optional>

#include "base/file_name.h"
#include "fuzz/fuzz_input.h"
#include "study/study_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace af;
  const auto path = fuzz::written("study.toml", fuzz::as_text({data, size}));
  std::optional<Study> study;
  if (!fuzz::is_accepted([&] { study = read_study(path); })) return 0;
  for (const StudyCase& study_case : study->cases) {
    fuzz::require(is_plain_file_name(study_case.name), "case names can be parts of file names");
    for (const StudyView& view : study_case.views)
      fuzz::require(study->rig.camera(view.camera).name == view.camera, "views have cameras");
  }
  const std::string text = study_to_toml(*study, fuzz::scratch_folder());
  const Study again = read_study(fuzz::written("again.toml", text));
  fuzz::require(study_to_toml(again, fuzz::scratch_folder()) == text,
                "a study reads back as it was written");
  return 0;
}
