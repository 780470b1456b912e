// SPDX-License-Identifier: Apache-2.0
#include "evaluate/registration/join_studies.h"

#include <iostream>
#include <set>

#include "base/error.h"
#include "files/output_file.h"
#include "ranks/root_only.h"
#include "study/rig_file.h"

namespace af::evaluation {
namespace {

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos;
       at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
  return text;
}

}  // namespace

void JoinStudiesOptions::describe(Fields& field) {
  field("studies", studies, "study.toml files").as("STUDY").required();
  field("fields",
        fields,
        "Path of every view's field, relative to the new study, such as "
        "fields/{case}-{camera}.af.h5 (default: as the studies do)");
  field("output", output, "The study to write").as("-o,--output");
}

Study joined_study(const std::vector<Study>& studies,
                   const std::string& fields,
                   const std::filesystem::path& path) {
  Study joined = studies.front();
  joined.path = std::filesystem::absolute(path);
  joined.cases.clear();
  std::set<std::string> names;
  for (const Study& study : studies) {
    if (rig_to_toml(study.rig) != rig_to_toml(joined.rig))
      throw InputError("rig",
                       study.rig_name_or_path,
                       "must have the same cameras as " + joined.rig_name_or_path,
                       study.path.string());
    for (const StudyCase& study_case : study.cases) {
      if (!names.insert(study_case.name).second)
        throw InputError(
            "name", study_case.name, "is the name of an earlier study's case", study.path.string());
      joined.cases.push_back(study_case);
    }
  }
  if (fields.empty()) return joined;
  for (StudyCase& study_case : joined.cases)
    for (StudyView& view : study_case.views)
      view.field = joined.path.parent_path() /
                   replaced(replaced(fields, "{case}", study_case.name), "{camera}", view.camera);
  return joined;
}

namespace {

void run_join_studies(const JoinStudiesOptions& options,
                      const std::string& /*command_line*/,
                      const Communicator& world) {
  do_on_root(world, [&] {
    announce_output(options.output);
    std::vector<Study> studies;
    for (const std::filesystem::path& path : options.studies) studies.push_back(read_study(path));
    const Study joined = joined_study(studies, options.fields, options.output);
    write_text_file(options.output, study_to_toml(joined, joined.path.parent_path()));
    std::cout << "study of " << joined.cases.size()
              << (joined.cases.size() == 1 ? " case: " : " cases: ") << options.output.string()
              << '\n';
  });
}

}  // namespace

cli::SubCommand join_studies_command(CLI::App& app) {
  return cli::sub_command(
      app,
      "join-studies",
      "One study.toml of the cases of several, which must have the same cameras",
      run_join_studies);
}

}  // namespace af::evaluation
