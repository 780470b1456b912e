// SPDX-License-Identifier: Apache-2.0
// What `af-evaluate report` makes of runs from elsewhere. Sound ones of every kind (runs/) are
// changed as the input says: values of summary.json and cells of tables become texts that mean
// something to HTML, file names that lead elsewhere, numbers out of range. There must be a page or
// one of our own errors; a page holds no element, attribute or link that it would not have by
// itself, and nothing of the file that lies beside the runs.
#include <array>
#include <cctype>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "evaluate/report/html_text.h"
#include "evaluate/report/report_page.h"
#include "files/output_file.h"
#include "fuzz/fuzz_input.h"

namespace {

namespace fs = std::filesystem;
using namespace af;
using namespace std::string_literals;
using nlohmann::json;

/// Its base64 stands whole in that of any text that begins with it.
const std::string kSecret = "af-secret-af-secret-af-secret-";

struct SampleRun {
  fs::path folder;
  std::string summary;
  json value;
  std::vector<json::json_pointer> places;     ///< of all values in it
  std::map<std::string, std::string> tables;  ///< CSV, by path below the folder
};

void collect_places(const json& value, const json::json_pointer& here, SampleRun& run) {
  run.places.push_back(here);
  if (value.is_object())
    for (const auto& [key, child] : value.items()) collect_places(child, here / key, run);
  if (value.is_array())
    for (std::size_t i = 0; i < value.size(); ++i) collect_places(value[i], here / i, run);
}

void write_bytes(const fs::path& path, const std::string& bytes) {
  fs::create_directories(path.parent_path());
  fuzz::written(path.lexically_relative(fuzz::scratch_folder()).string(), bytes);
}

/// A sound run: its texts from the sources, figures and pictures that nobody looks at.
SampleRun sample_run(const fs::path& source, const std::string& name) {
  SampleRun run;
  run.folder = fuzz::scratch_folder() / "runs" / name;
  for (const auto& entry : fs::recursive_directory_iterator(source)) {
    if (!entry.is_regular_file()) continue;
    const std::string path = entry.path().lexically_relative(source).string();
    const std::string text = read_text_file(entry.path());
    write_bytes(run.folder / path, text);
    if (entry.path().extension() == ".csv") run.tables[path] = text;
  }
  run.summary = read_text_file(source / "summary.json");
  run.value = json::parse(run.summary);
  collect_places(run.value, json::json_pointer(), run);
  for (const char* figure : {"success-rate",
                             "tre-scatter",
                             "tre-histogram",
                             "psnr",
                             "loss-split",
                             "similarity-curves",
                             "field-parameters"})
    write_bytes(run.folder / (figure + ".svg"s), "<svg/>");
  for (const char* picture :
       {"ellipsoids-xrays", "ellipsoids-best-AP", "worst-pair", "median-pair", "difference-images"})
    write_bytes(run.folder / (picture + ".png"s), "PNG");
  fs::create_symlink("../../secret", run.folder / "link");
  fs::create_symlink("../..", run.folder / "up");
  return run;
}

/// The last two are drawn side by side with those of their kind.
std::vector<SampleRun> sample_runs() {
  write_bytes(fuzz::scratch_folder() / "secret", kSecret);
  // Stands for gnuplot, which would take all the time.
  const fs::path program = fuzz::scratch_folder() / "bin" / "gnuplot";
  write_bytes(program, "#!/bin/sh\necho '<svg/>'\n");
  fs::permissions(program, fs::perms::owner_all);
  const char* const path = std::getenv("PATH");
  setenv("PATH", (program.parent_path().string() + ":" + (path == nullptr ? "" : path)).c_str(), 1);
  std::vector<SampleRun> runs;
  for (const char* name :
       {"registration", "image-quality", "similarity-curves", "field-parameters", "error-budget"})
    runs.push_back(sample_run(fs::path(AF_FUZZ_RUNS) / name, name));
  for (const char* name : {"registration", "image-quality"})
    runs.push_back(sample_run(fs::path(AF_FUZZ_RUNS) / name, "more/"s + name));
  return runs;
}

json any_value(fuzz::InputBytes& input) {
  static const std::vector<json> values = {"<script>af()</script>",
                                           "\"><img src=x onerror=af()>",
                                           "' onload='af()",
                                           "</style><b>",
                                           "&lt;",
                                           "",
                                           "../../secret",
                                           "../secret",
                                           "link",
                                           "up/secret",
                                           ".",
                                           "..",
                                           "//host/x",
                                           "javascript:af()",
                                           "/etc/hostname",
                                           "summary.json",
                                           "a\0b"s,
                                           "line\nline",
                                           "nan",
                                           "inf",
                                           "-1",
                                           "1e300",
                                           "0.5",
                                           std::string(300, 'n'),
                                           nullptr,
                                           true,
                                           0,
                                           -1,
                                           1,
                                           1000000,
                                           0.5,
                                           1e300,
                                           -1e300,
                                           std::uint64_t{1} << 63,
                                           json::array(),
                                           json::object(),
                                           {1, 2, 3},
                                           {{"a", {"<b>"}}},
                                           "field",
                                           "raycast",
                                           "registration",
                                           "image-quality"};
  const std::size_t chosen = input.take_below(values.size() + 1);
  if (chosen < values.size()) return values[chosen];
  const std::string text(fuzz::as_text(input.take_bytes(input.take_below(64))));
  const json value = json::parse(text, nullptr, false);
  if (!value.is_discarded()) return value;
  // JSON holds UTF-8 only.
  return json::parse(json(text).dump(-1, ' ', false, json::error_handler_t::replace));
}

void change_summary(SampleRun& run, json& summary, fuzz::InputBytes& input) {
  const json::json_pointer place = run.places[input.take_below(run.places.size())];
  const bool is_removed = input.take_below(8) == 0;
  if (!summary.contains(place)) return;
  if (is_removed && !place.empty()) {
    json& parent = summary[place.parent_pointer()];
    if (parent.is_object())
      parent.erase(place.back());
    else
      parent.erase(std::stoul(place.back()));
    return;
  }
  summary[place] = any_value(input);
}

/// A cell, or any byte, of a table.
void change_table(std::string& table, fuzz::InputBytes& input) {
  const std::size_t place = input.take_below(table.size() + 1);
  const json value = any_value(input);
  const std::string text = value.is_string() ? value.get<std::string>() : value.dump();
  const std::size_t end = std::min(table.find_first_of(",\n", place), table.size());
  const std::size_t before = place == 0 ? std::string::npos : table.find_last_of(",\n", place - 1);
  const std::size_t begin = before == std::string::npos ? 0 : before + 1;
  std::string cell = text;
  if (input.take_below(2) == 0) {
    cell = "\"";
    for (const char character : text) cell += character == '"' ? "\"\"" : std::string(1, character);
    cell += '"';
  }
  table.replace(begin, end - begin, cell);
}

/// Writes the chosen runs anew, some of them changed.
void change_runs(std::vector<SampleRun*>& chosen, fuzz::InputBytes& input) {
  std::vector<json> summaries;
  std::vector<std::map<std::string, std::string>> tables;
  for (const SampleRun* run : chosen) {
    summaries.push_back(run->value);
    tables.push_back(run->tables);
  }
  constexpr int kMostEdits = 8;
  for (int edits = 0; edits < kMostEdits && !input.empty(); ++edits) {
    const std::size_t run = input.take_below(chosen.size());
    const std::size_t file = input.take_below(8);
    if (file < tables[run].size())
      change_table(std::next(tables[run].begin(), static_cast<std::ptrdiff_t>(file))->second,
                   input);
    else
      change_summary(*chosen[run], summaries[run], input);
  }
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    write_bytes(chosen[i]->folder / "summary.json", summaries[i].dump());
    for (const auto& [path, text] : tables[i]) write_bytes(chosen[i]->folder / path, text);
  }
}

bool is_name(char character) {
  return std::isalnum(static_cast<unsigned char>(character)) != 0 || character == '-';
}

/// The value of an attribute that leads somewhere is a path or an anchor of this page, or data.
void check_attribute(std::string_view name, std::string_view value) {
  static const std::set<std::string_view> known = {"class",
                                                   "id",
                                                   "href",
                                                   "src",
                                                   "alt",
                                                   "lang",
                                                   "charset",
                                                   "name",
                                                   "content",
                                                   "scope",
                                                   "style",
                                                   "role",
                                                   "viewBox",
                                                   "aria-label",
                                                   "x1",
                                                   "x2",
                                                   "y1",
                                                   "y2",
                                                   "points"};
  fuzz::require(known.contains(name), "the page has no attribute of the input");
  fuzz::require(value.find('<') == std::string_view::npos, "no attribute holds a tag");
  if (name == "href")
    fuzz::require(!value.starts_with('/') && value.find(':') == std::string_view::npos,
                  "links are paths below the page's folder or its neighbours");
  if (name == "src")
    fuzz::require(value.starts_with("data:image/"), "pictures are part of the page");
}

/// Checks the tag that begins at `at`; returns its end.
std::size_t check_tag(std::string_view page, std::size_t at) {
  static const std::set<std::string_view> known = {
      "html",    "head",    "meta", "title",    "style", "body",   "main",       "header",
      "footer",  "section", "h1",   "h2",       "h3",    "p",      "a",          "nav",
      "ul",      "li",      "div",  "span",     "b",     "strong", "small",      "sub",
      "code",    "pre",     "br",   "table",    "thead", "tbody",  "tr",         "th",
      "td",      "dl",      "dt",   "dd",       "img",   "figure", "figcaption", "details",
      "summary", "svg",     "line", "polyline", "script"};
  at += page.substr(at).starts_with("</") ? 2u : 1u;
  std::size_t end = at;
  while (end < page.size() && is_name(page[end])) ++end;
  fuzz::require(known.contains(page.substr(at, end - at)), "the page has no element of the input");
  while (end < page.size() && page[end] == ' ') {
    const std::size_t name = end + 1;
    end = name;
    while (end < page.size() && is_name(page[end])) ++end;
    fuzz::require(page.substr(end, 2) == "=\"", "attributes have values in quotes");
    const std::size_t value = end + 2;
    end = std::min(page.find('"', value), page.size());
    check_attribute(page.substr(name, value - 2 - name), page.substr(value, end - value));
    ++end;
  }
  if (end < page.size() && page[end] == '/') ++end;
  fuzz::require(end < page.size() && page[end] == '>', "a tag ends");
  return end + 1;
}

void check_page(std::string_view page) {
  constexpr std::string_view kDoctype = "<!DOCTYPE html>\n";
  fuzz::require(page.starts_with(kDoctype), "the page is HTML");
  int scripts = 0;
  int styles = 0;
  for (std::size_t at = page.find('<', kDoctype.size()); at != std::string_view::npos;) {
    const std::string_view rest = page.substr(at);
    std::size_t end = check_tag(page, at);
    // What our own script and style hold is no HTML.
    if (rest.starts_with("<script")) {
      ++scripts;
      end = page.find("</script>", end);
    } else if (rest.starts_with("<style")) {
      ++styles;
      end = page.find("</style>", end);
    }
    at = page.find('<', end);
  }
  fuzz::require(scripts == 1 && styles == 1, "the page has its own script and style only");
  static const std::string secret = evaluation::base64(kSecret);
  fuzz::require(
      page.find(kSecret) == std::string_view::npos && page.find(secret) == std::string_view::npos,
      "the page holds nothing of files beside the runs");
}

/// Which of the runs an input is about; two of a kind, which are drawn, only now and then.
std::vector<SampleRun*> chosen_runs(std::vector<SampleRun>& runs, fuzz::InputBytes& input) {
  constexpr std::size_t kKinds = 5;
  std::vector<SampleRun*> chosen = {&runs[input.take_below(kKinds)]};
  const std::size_t other = input.take_below(64);
  if (other < runs.size() && chosen.front() != &runs[other]) chosen.push_back(&runs[other]);
  return chosen;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static std::vector<SampleRun> runs = sample_runs();
  fuzz::InputBytes input(data, size);
  const bool is_raw = input.take_below(8) == 1;
  std::vector<SampleRun*> chosen = chosen_runs(runs, input);
  const bool is_unchanged = input.empty();
  const std::string raw(is_raw ? fuzz::as_text(input.take_bytes(input.rest().size())) : "");
  change_runs(chosen, input);
  if (is_raw) write_bytes(chosen.front()->folder / "summary.json", raw);
  std::vector<fs::path> folders;
  for (const SampleRun* run : chosen) folders.push_back(run->folder);
  std::string page;
  const bool is_accepted = fuzz::is_accepted([&] {
    page = evaluation::report_page(
        evaluation::find_runs(folders), fuzz::scratch_folder() / "page.html", "");
  });
  if (is_accepted) check_page(page);
  fuzz::require(is_accepted || is_raw || !is_unchanged, "sound runs give a page");
  return 0;
}
