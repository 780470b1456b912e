// SPDX-License-Identifier: Apache-2.0
#include "cli/shell_completion.h"

#include <algorithm>
#include <vector>

namespace af::cli {

namespace {

std::string words_of(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
  return text;
}

std::string function_name(std::string program) {
  std::replace(program.begin(), program.end(), '-', '_');
  return "_" + program;
}

std::string option_words(const CommandHelp& command) {
  std::vector<std::string> words;
  for (const OptionHelp& option : command.options)
    if (!option.is_positional) words.insert(words.end(), option.names.begin(), option.names.end());
  return words_of(words);
}

/// Cases of "COMMAND OPTION" whose values are known names.
void add_bash_choices(const CommandHelp& command, const std::string& name, std::string& script) {
  for (const OptionHelp& option : command.options) {
    if (option.choices.empty() || option.is_positional) continue;
    std::string patterns;
    for (const std::string& option_name : option.names)
      patterns += std::string(patterns.empty() ? "" : " | ")
                      .append("\"")
                      .append(name)
                      .append(" ")
                      .append(option_name)
                      .append("\"");
    script += "    " + patterns + ") names=\"" + words_of(option.choices) + "\" ;;\n";
  }
}

/// Options whose values are not names complete to files, so bash is left to it.
void add_bash_values(const CommandHelp& command, const std::string& name, std::string& script) {
  std::string patterns;
  for (const OptionHelp& option : command.options)
    if (!option.value_word.empty() && option.choices.empty() && !option.is_positional)
      for (const std::string& option_name : option.names)
        patterns += std::string(patterns.empty() ? "" : " | ")
                        .append("\"")
                        .append(name)
                        .append(" ")
                        .append(option_name)
                        .append("\"");
  if (!patterns.empty()) script += "    " + patterns + ") return ;;\n";
}

void add_bash_options(const CommandHelp& command, const std::string& name, std::string& script) {
  script += "    \"" + name + "\") options=\"" + option_words(command) + "\" ;;\n";
}

std::vector<std::string> command_names(const CommandHelp& program) {
  std::vector<std::string> names;
  names.reserve(program.commands.size());
  for (const CommandHelp& command : program.commands) names.push_back(command.name);
  return names;
}

/// Text between single quotes in a specification of _arguments.
std::string zsh_text(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\'')
      escaped += "'\\''";
    else if (c == '[' || c == ']' || c == ':' || c == '\\')
      escaped += std::string("\\") + c;
    else
      escaped += c == '\n' ? ' ' : c;
  }
  return escaped;
}

std::string zsh_action(const OptionHelp& option) {
  if (!option.choices.empty()) return "(" + words_of(option.choices) + ")";
  const bool is_folder = option.path_role == PathRole::InputFolder;
  if (option.kind == OptionHelp::Kind::Path) return is_folder ? "_files -/" : "_files";
  return option.kind == OptionHelp::Kind::Text ? "_files" : " ";
}

std::string zsh_specification(const OptionHelp& option) {
  const std::string value =
      option.value_word.empty() ? "" : ":" + zsh_text(option.value_word) + ":" + zsh_action(option);
  if (option.is_positional) return "'*" + value + "'";
  const std::string text = "[" + zsh_text(option.text) + "]" + value + "'";
  if (option.is_repeated) return "'*" + option.long_name() + text;
  if (option.names.size() == 1) return "'" + option.names.front() + text;
  std::string braces;
  for (const std::string& name : option.names) braces += (braces.empty() ? "" : ",") + name;
  return "'(" + words_of(option.names) + ")'{" + braces + "}'" + text;
}

void add_zsh_arguments(const CommandHelp& command,
                       const std::string& indent,
                       const std::vector<std::string>& more,
                       std::string& script) {
  script += indent + "_arguments " + (more.empty() ? "" : "-C");
  for (const OptionHelp& option : command.options)
    script.append(" \\\n").append(indent).append("  ").append(zsh_specification(option));
  for (const std::string& specification : more)
    script.append(" \\\n").append(indent).append("  ").append(specification);
  script += "\n";
}

}  // namespace

std::string bash_completion(const CommandHelp& program) {
  const std::string function = function_name(program.name);
  const std::vector<std::string> commands = command_names(program);
  std::string script =
      "# bash completion of " + program.name + ", made by " + program.name + " --help-as bash\n" +
      function +
      "() {\n"
      "  local current=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]}\n"
      "  local command=\"\" options=\"\" names=\"\" word\n"
      "  COMPREPLY=()\n";
  if (!commands.empty()) {
    std::string patterns;
    for (const std::string& name : commands) patterns += (patterns.empty() ? "" : " | ") + name;
    script +=
        "  for word in \"${COMP_WORDS[@]:1:COMP_CWORD-1}\"; do\n    case \"$word\" in\n      " +
        patterns + ") command=$word; break ;;\n    esac\n  done\n";
  }
  script += "  case \"$command\" in\n";
  add_bash_options(program, "", script);
  for (const CommandHelp& command : program.commands)
    add_bash_options(command, command.name, script);
  script += "  esac\n";
  if (!commands.empty())
    script += "  [[ -n \"$command\" ]] || options+=\" " + words_of(commands) + "\"\n";
  script += "  case \"$command $before\" in\n";
  add_bash_choices(program, "", script);
  add_bash_values(program, "", script);
  for (const CommandHelp& command : program.commands) {
    add_bash_choices(command, command.name, script);
    add_bash_values(command, command.name, script);
  }
  script +=
      "  esac\n"
      "  if [[ -n \"$names\" ]]; then\n"
      "    mapfile -t COMPREPLY < <(compgen -W \"$names\" -- \"$current\")\n";
  script += commands.empty() ? "  elif [[ \"$current\" == -* ]]; then\n"
                             : "  elif [[ \"$current\" == -* || -z \"$command\" ]]; then\n";
  script +=
      "    mapfile -t COMPREPLY < <(compgen -W \"$options\" -- \"$current\")\n"
      "  fi\n"
      "}\n"
      "complete -o default -F " +
      function + " " + program.name + "\n";
  return script;
}

std::string zsh_completion(const CommandHelp& program) {
  std::string script = "#compdef " + program.name + "\n# Made by " + program.name +
                       " --help-as zsh\n" + function_name(program.name) + "() {\n";
  const std::vector<std::string> commands = command_names(program);
  if (commands.empty()) {
    add_zsh_arguments(program, "  ", {}, script);
  } else {
    script += "  local curcontext=\"$curcontext\" state line\n";
    add_zsh_arguments(program,
                      "  ",
                      {"'1:command:(" + words_of(commands) + ")'", "'*::argument:->arguments'"},
                      script);
    script += "  [[ \"$state\" == arguments ]] || return\n  case \"$line[1]\" in\n";
    for (const CommandHelp& command : program.commands) {
      script += "    " + command.name + ")\n";
      add_zsh_arguments(command, "      ", {}, script);
      script += "      ;;\n";
    }
    script += "  esac\n";
  }
  return script + "}\n" + function_name(program.name) + " \"$@\"\n";
}

}  // namespace af::cli
