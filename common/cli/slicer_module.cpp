// SPDX-License-Identifier: Apache-2.0
#include "cli/slicer_module.h"

#include <algorithm>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/build_info.h"

namespace af::cli {

namespace {

std::string xml_text(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '&')
      escaped += "&amp;";
    else if (c == '<')
      escaped += "&lt;";
    else if (c == '>')
      escaped += "&gt;";
    else
      escaped += c;
  }
  return escaped;
}

std::string element(const std::string& name, const std::string& text) {
  return "<" + name + ">" + xml_text(text) + "</" + name + ">";
}

/// Slicer's widgets for numbers read plain decimals only, and give them back with as many digits.
bool is_plain_decimal(const std::string& text) {
  return !text.empty() && text.find_first_not_of("+-0123456789.") == std::string::npos;
}

/// What Slicer calls a kind of option.
struct Parameter {
  std::string tag;
  std::string attributes;
  std::string channel;  ///< "input", "output" or none
};

Parameter path_parameter(const OptionHelp& option) {
  const std::string endings = option.file_endings.empty()
                                  ? ""
                                  : " fileExtensions=\"" + xml_text(option.file_endings) + "\"";
  switch (option.path_role) {
    case PathRole::InputFolder:
      return {"directory", "", "input"};
    case PathRole::InputVolume:
      return {"image", endings, "input"};
    case PathRole::InputTransform:
      return {"transform", " type=\"linear\"" + endings, "input"};
    case PathRole::OutputFile:
      return {"file", endings, "output"};
    case PathRole::OutputFolder:
      return {"directory", "", "output"};
    case PathRole::OutputVolume:
      return {"image", endings, "output"};
    case PathRole::Unsaid:
    case PathRole::InputFile:
      break;
  }
  return {"file", endings, "input"};
}

/// Slicer leaves out empty texts and vectors, but always gives numbers and choices. An option whose
/// presence has a meaning must therefore be a text.
Parameter parameter_of(const OptionHelp& option) {
  using Kind = OptionHelp::Kind;
  if (option.kind == Kind::Flag) return {"boolean", "", ""};
  if (option.path_role != PathRole::Unsaid || option.kind == Kind::Path)
    return path_parameter(option);
  const bool is_integer = option.kind == Kind::Integer;
  const bool is_number = is_integer || option.kind == Kind::Number;
  if (is_number && option.is_comma_separated)
    return {is_integer ? "integer-vector" : "double-vector", "", ""};
  if (option.default_text.empty() || option.depends_on_others || option.is_list)
    return {"string", "", ""};
  if (!option.choices.empty() && !is_number) return {"string-enumeration", "", ""};
  if (!is_number || !is_plain_decimal(option.default_text)) return {"string", "", ""};
  return {is_integer ? "integer" : "double", "", ""};
}

std::string identifier(const OptionHelp& option) {
  const std::string& name = option.long_name();
  std::string text = name.substr(name.find_first_not_of('-'));
  std::replace(text.begin(), text.end(), '-', '_');
  return text;
}

std::string label_of(const OptionHelp& option) {
  std::string text = identifier(option);
  std::replace(text.begin(), text.end(), '_', ' ');
  return text;
}

/// A slider from the smallest to the largest value.
std::string constraints_of(const OptionHelp& option, const Parameter& parameter) {
  const bool is_integer = parameter.tag == "integer";
  if ((!is_integer && parameter.tag != "double") || !option.low || !option.high) return "";
  constexpr double kSteps = 100.0;
  const auto text = [](double value) { return CLI::detail::to_string(value); };
  return "      <constraints>" + element("minimum", text(*option.low)) +
         element("maximum", text(*option.high)) +
         element("step", is_integer ? "1" : text((*option.high - *option.low) / kSteps)) +
         "</constraints>\n";
}

std::string described(const OptionHelp& option, const Parameter& parameter) {
  std::string text = option.text;
  if (!option.choices.empty() && parameter.tag == "string") {
    text += ". One of:";
    for (const std::string& name : option.choices) text += " " + name;
  } else if (!option.constraint.empty()) {
    text += ". Must be " + option.constraint;
  }
  return text + (option.is_required ? ". Required" : "");
}

void add_parameter(const OptionHelp& option, std::string& xml) {
  const Parameter parameter = parameter_of(option);
  const std::string indent = "      ";
  xml += "    <" + parameter.tag + parameter.attributes + ">\n";
  xml += indent + element("name", identifier(option)) + "\n";
  if (option.names.front().size() == 2)
    xml += indent + element("flag", option.names.front().substr(1)) + "\n";
  xml += indent + element("longflag", identifier(option)) + "\n";
  xml += indent + element("description", described(option, parameter)) + "\n";
  xml += indent + element("label", label_of(option)) + "\n";
  if (!parameter.channel.empty()) xml += indent + element("channel", parameter.channel) + "\n";
  const std::string value = parameter.tag == "boolean" ? "false" : option.default_text;
  if (!value.empty()) xml += indent + element("default", value) + "\n";
  if (parameter.tag == "string-enumeration")
    for (const std::string& name : option.choices) xml += indent + element("element", name) + "\n";
  xml += constraints_of(option, parameter);
  xml += "    </" + parameter.tag + ">\n";
}

/// The panel of an option: first "Files" for what the module reads and writes, then what has no
/// heading, then the headings.
std::string panel_of(const OptionHelp& option) {
  if (option.is_required || option.path_role != PathRole::Unsaid) return "Files";
  return option.group;
}

}  // namespace

std::string slicer_xml(const CommandHelp& program,
                       const std::string& title,
                       const std::string& version) {
  std::string xml = "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<executable>\n";
  const auto add = [&](const std::string& name, const std::string& text) {
    xml += "  " + element(name, text) + "\n";
  };
  add("category", "Registration.Attenuation fields");
  add("title", title);
  add("description", program.text);
  add("version", version);
  add("documentation-url", "");
  add("license", "Apache-2.0");
  add("contributor", "The authors of attenuation_fields");
  std::vector<std::string> panels = {"Files", "Options"};
  for (const OptionHelp& option : program.options)
    if (std::find(panels.begin(), panels.end(), panel_of(option)) == panels.end())
      panels.push_back(panel_of(option));
  for (const std::string& panel : panels) {
    const bool is_advanced = panel != "Files" && panel != "Options";
    xml += std::string("  <parameters") + (is_advanced ? " advanced=\"true\"" : "") + ">\n    " +
           element("label", panel) + "\n    " + element("description", panel) + "\n";
    for (const OptionHelp& option : program.options)
      if (!option.is_positional && !option.is_of_every_program && panel_of(option) == panel)
        add_parameter(option, xml);
    xml += "  </parameters>\n";
  }
  return xml + "</executable>";
}

void bind_slicer_module(CLI::App& app, const std::string& title) {
  app.add_flag_callback(
         "--xml",
         // CLI11 prints the text of this "error" and ends the line, on one rank, with exit code 0.
         [&app, title] {
           throw CLI::CallForVersion(
               slicer_xml(command_help(app), title, std::string(program_version())), 0);
         },
         "Print the options as XML for 3D Slicer, which makes a module of it, and exit")
      ->trigger_on_parse();
}

std::string with_dashes(const CLI::App& app, const std::string& argument) {
  if (!argument.starts_with("--")) return argument;
  const std::size_t end = std::min(argument.find('='), argument.size());
  std::string name = argument.substr(0, end);
  std::replace(name.begin(), name.end(), '_', '-');
  if (app.get_option_no_throw(name) != nullptr) return name + argument.substr(end);
  for (const CLI::App* part : app.get_subcommands([](const CLI::App*) { return true; })) {
    std::string found = with_dashes(*part, argument);
    if (found != argument) return found;
  }
  return argument;
}

}  // namespace af::cli
