// SPDX-License-Identifier: Apache-2.0
#include "cli/help_pages.h"

#include <algorithm>
#include <cctype>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/joined.h"

namespace af::cli {

namespace {

/// Options by their headings, in the order in which these first appear.
std::vector<std::pair<std::string, std::vector<const OptionHelp*>>> by_group(
    const CommandHelp& command) {
  std::vector<std::pair<std::string, std::vector<const OptionHelp*>>> groups;
  for (const OptionHelp& option : command.options) {
    auto found = std::find_if(groups.begin(), groups.end(), [&](const auto& group) {
      return group.first == option.group;
    });
    if (found == groups.end()) found = groups.insert(groups.end(), {option.group, {}});
    found->second.push_back(&option);
  }
  return groups;
}

/// "NUMBER,..." or "NUMBER ...": how a value is typed.
std::string value_text(const OptionHelp& option) {
  if (option.value_word.empty()) return "";
  if (option.is_comma_separated && option.value_word.find(',') == std::string::npos)
    return option.value_word + ",...";
  return option.value_word + (option.is_repeated ? " ..." : "");
}

/// Whether the text says of every choice what it is, as in "fast: ...".
bool explains_choices(const OptionHelp& option) {
  return std::all_of(option.choices.begin(), option.choices.end(), [&](const std::string& choice) {
    return option.text.find(choice + ": ") != std::string::npos;
  });
}

/// What the option does and accepts, as sentences.
std::string sentences(const OptionHelp& option) {
  std::string text = option.text;
  if (!option.choices.empty())
    text += explains_choices(option) ? "" : ". One of: " + joined(option.choices);
  else if (!option.constraint.empty())
    text += ". Must be " + option.constraint;
  if (option.is_required) text += ". Required";
  return text;
}

// --- Markdown ------------------------------------------------------------------------------------

/// Text of a table's cell.
std::string cell(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '|' || c == '<' || c == '*' || c == '\\' || c == '`') escaped += '\\';
    escaped += c == '\n' ? ' ' : c;
  }
  return escaped;
}

std::string code(const std::string& text) {
  return text.empty() ? "" : "`" + text + "`";
}

/// A row of a table of options.
std::string markdown_row(const OptionHelp& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.names) names.push_back(code(name));
  return "| " + joined(names) + " | " + code(value_text(option)) + " | " +
         code(option.default_text) + " | " + cell(sentences(option)) + " |\n";
}

/// Rows that an earlier command's table has (`shown`) are not repeated: only the options' names are
/// written.
void add_markdown(const CommandHelp& command,
                  const std::string& heading,
                  std::set<std::string>& shown,
                  std::string& page) {
  const std::string mark = std::string(heading.find(' ') == std::string::npos ? "#" : "##");
  page += mark + " " + heading + "\n\n" + command.text + "\n";
  for (const auto& [group, options] : by_group(command)) {
    std::string rows;
    std::vector<std::string> above;
    for (const OptionHelp* option : options) {
      const std::string row = markdown_row(*option);
      if (shown.insert(row).second)
        rows += row;
      else
        above.push_back(code(option->long_name()));
    }
    if (group != "Options") page += "\n**" + group + "**\n";
    if (!rows.empty())
      page += "\n| Option | Value | Default | What it does |\n|---|---|---|---|\n" + rows;
    if (!above.empty()) page += "\nAs above: " + joined(above) + ".\n";
  }
  for (const CommandHelp& part : command.commands) {
    page += "\n";
    add_markdown(part, heading + " " + part.name, shown, page);
  }
}

// --- man -----------------------------------------------------------------------------------------

std::string roff(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    const bool begins_line = escaped.empty() || escaped.back() == '\n';
    if (begins_line && (c == '.' || c == '\'')) escaped += "\\&";
    if (c == '\\')
      escaped += "\\e";
    else if (c == '-')
      escaped += "\\-";
    else
      escaped += c;
  }
  return escaped;
}

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

/// The text before the end of its first sentence.
std::string first_sentence(const std::string& text) {
  std::size_t end = std::min(text.find(". "), text.find(".\n"));
  end = std::min(end, text.size());
  while (end > 0 && text[end - 1] == '.') --end;
  return text.substr(0, end);
}

void add_man_options(const CommandHelp& command, std::string& page) {
  for (const auto& [group, options] : by_group(command)) {
    if (group != "Options") page += ".PP\n.I \"" + roff(group) + "\"\n";
    for (const OptionHelp* option : options) {
      page += ".TP\n";
      for (std::size_t i = 0; i < option->names.size(); ++i)
        page += (i == 0 ? "" : ", ") + ("\\fB" + roff(option->names[i]) + "\\fR");
      const std::string value = value_text(*option);
      if (!value.empty()) page += " \\fI" + roff(value) + "\\fR";
      page += "\n" + roff(sentences(*option)) + ".";
      if (!option->default_text.empty()) page += " Default: " + roff(option->default_text) + ".";
      page += "\n";
    }
  }
}

constexpr std::string_view kManEnd = R"(.SH EXIT STATUS
0 done, 2 usage, 3 unacceptable input, 4 unreadable or wrong file, 5 numerics, 6 internal, 7
.BR af\-register (1)
found nothing, 75 stopped with progress saved.
.SH SEE ALSO
.BR af\-precompute (1),
.BR af\-drr (1),
.BR af\-simulate (1),
.BR af\-register (1),
.BR af\-evaluate (1),
.BR af\-inspect (1),
/usr/share/doc/attenuation\-fields
)";

}  // namespace

std::string markdown_page(const CommandHelp& program) {
  std::string page;
  std::set<std::string> shown;
  add_markdown(program, program.name, shown, page);
  return page;
}

std::string man_page(const CommandHelp& program, const std::string& version) {
  std::string page = ".TH " + upper(roff(program.name)) + " 1 \"\" \"attenuation\\-fields " +
                     roff(version) + "\" \"User Commands\"\n.SH NAME\n" + roff(program.name) +
                     " \\- " + roff(first_sentence(program.text)) + "\n.SH SYNOPSIS\n.B " +
                     roff(program.name) + (program.commands.empty() ? "\n" : "\n.I COMMAND\n") +
                     "[\\fIOPTIONS\\fR]\n.SH DESCRIPTION\n" + roff(program.text) +
                     "\n.SH OPTIONS\n";
  add_man_options(program, page);
  if (!program.commands.empty()) page += ".SH COMMANDS\n";
  for (const CommandHelp& command : program.commands) {
    page += ".SS " + roff(command.name) + "\n" + roff(command.text) + "\n";
    add_man_options(command, page);
  }
  return page + std::string(kManEnd);
}

}  // namespace af::cli
