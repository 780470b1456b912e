# SPDX-License-Identifier: Apache-2.0
"""--help-as: the help of argparse as a page of Markdown, a manual page, or a completion for a shell."""
import argparse


class HelpAs(argparse.Action):
    def __call__(self, parser, namespace, value, option_string=None):
        print({"markdown": markdown, "man": man, "bash": bash, "zsh": zsh}[value](parser), end="")
        parser.exit()


def add_help_formats(parser):
    parser.add_argument("--help-as", action=HelpAs, metavar="TEXT", choices=["markdown", "man", "bash", "zsh"],
                        help="Print this help as a page of Markdown, a manual page, or a completion for a shell, and exit. One of: "
                        "markdown, man, bash, zsh")


def entries(parser):
    """(names, value, help) of every option and argument."""
    for action in parser._actions:
        is_flag = action.nargs == 0
        yield action.option_strings or [action.metavar or action.dest], "" if is_flag or not action.option_strings else action.metavar, action.help


def options(parser):
    return " ".join(name for names, _, _ in entries(parser) for name in names if name.startswith("-"))


def markdown(parser):
    rows = [f"| {', '.join(f'`{name}`' for name in names)} | {f'`{value}`' if value else ''} | {text.replace('|', '&#124;')} |\n"
            for names, value, text in entries(parser)]
    return f"# {parser.prog}\n\n{parser.description}\n\n| Option | Value | What it does |\n|---|---|---|\n{''.join(rows)}"


def man(parser):
    def escaped(text):
        return text.replace("\\", "\\\\").replace("-", "\\-")

    first = parser.description.split(". ")[0]
    text = (f'.TH {escaped(parser.prog.upper())} 1 "" "attenuation\\-fields" "User Commands"\n.SH NAME\n{escaped(parser.prog)} \\- '
            f"{escaped(first)}\n.SH SYNOPSIS\n.B {escaped(parser.prog)}\n[\\fIOPTIONS\\fR] \\fIPATH\\fR...\n.SH DESCRIPTION\n"
            f"{escaped(parser.description)}\n.SH OPTIONS\n")
    for names, value, help_text in entries(parser):
        shown = ", ".join(f"\\fB{escaped(name)}\\fR" for name in names)
        text += f".TP\n{shown}{f' {chr(92)}fI{escaped(value)}{chr(92)}fR' if value else ''}\n{escaped(help_text)}.\n"
    return text


def bash(parser):
    name = parser.prog.replace("-", "_")
    return (f"# bash completion of {parser.prog}, made by {parser.prog} --help-as bash\n_{name}() {{\n  COMPREPLY=()\n"
            f'  if [[ "${{COMP_WORDS[COMP_CWORD]}}" == -* ]]; then\n'
            f'    mapfile -t COMPREPLY < <(compgen -W "{options(parser)}" -- "${{COMP_WORDS[COMP_CWORD]}}")\n  fi\n}}\n'
            f"complete -o default -F _{name} {parser.prog}\n")


def zsh(parser):
    return f"#compdef {parser.prog}\n_arguments {' '.join(options(parser).split())} '*:file:_files'\n"
