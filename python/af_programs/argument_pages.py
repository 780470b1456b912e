# SPDX-License-Identifier: Apache-2.0
"""The options that every program has: --version, and --help-as markdown, man, bash or zsh, which prints its help as a page."""
import argparse
import re

VERSION = "0.2.0"


class HelpAs(argparse.Action):
    """--help-as KIND prints the page and exits."""

    def __call__(self, parser, namespace, values, option_string=None):
        print(PAGES[values](parser), end="")
        parser.exit()


def add_common_options(parser):
    parser.add_argument("--version", action="version", version=f"{parser.prog} {VERSION}", help="print the version and exit")
    parser.add_argument("--help-as", choices=list(PAGES), action=HelpAs, metavar="KIND", help="print this help as a page of Markdown, a "
                        "manual page, or a completion for a shell, and exit: " + ", ".join(PAGES))


def _entries(parser):
    """(title, [(names, value, help, choices)]) for each group."""
    for group in parser._action_groups:
        yield group.title, [(action.option_strings, "" if action.nargs == 0 else action.metavar or action.dest.upper(),
                             action.help[:1].upper() + action.help[1:], action.choices) for action in group._group_actions]


def _options(parser):
    return [entry for _, entries in _entries(parser) for entry in entries if entry[0]]


def _markdown(parser):
    text = f"# {parser.prog}\n\n{parser.description}\n"
    for title, entries in _entries(parser):
        text += f"\n**{title[:1].upper()}{title[1:]}**\n\n| Option | Value | What it does |\n|---|---|---|\n"
        for names, value, help_text, _ in entries:
            shown = ", ".join(f"`{name}`" for name in names) or f"`{value}`"
            shown_help = help_text.replace("|", "&#124;")
            text += f"| {shown} | {f'`{value}`' if names and value else ''} | {shown_help} |\n"
    return text


def _roff(text):
    return text.replace("\\", "\\e").replace("-", "\\-")


def _man(parser):
    text = (f'.TH {_roff(parser.prog.upper())} 1 "" "attenuation\\-fields" "User Commands"\n.SH NAME\n{_roff(parser.prog)} \\- '
            f"{_roff(parser.description.partition('.')[0])}\n.SH SYNOPSIS\n.B {_roff(parser.prog)}\n[\\fIOPTIONS\\fR] ...\n"
            f".SH DESCRIPTION\n{_roff(parser.description)}\n")
    for title, entries in _entries(parser):
        text += f".SH {_roff(title.upper())}\n"
        for names, value, help_text, _ in entries:
            shown = [", ".join(f"\\fB{_roff(name)}\\fR" for name in names), f"\\fI{_roff(value)}\\fR" if value else ""]
            text += f".TP\n{' '.join(filter(None, shown))}\n{_roff(help_text)}\n"
    return text


def _bash(parser):
    options = _options(parser)
    function, names = "_" + parser.prog.replace("-", "_"), " ".join(name for entry in options for name in entry[0])
    choices = "".join(f'    {" | ".join(names)}) names="{" ".join(values)}" ;;\n' for names, _, _, values in options if values)
    return (f"# bash completion of {parser.prog}, made by {parser.prog} --help-as bash\n{function}() {{\n"
            '  local current=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} names=""\n'
            f'  COMPREPLY=()\n  case "$before" in\n{choices}  esac\n  [[ -n "$names" || "$current" != -* ]] || names="{names}"\n'
            '  [[ -z "$names" ]] || mapfile -t COMPREPLY < <(compgen -W "$names" -- "$current")\n}\n'
            f"complete -o default -F {function} {parser.prog}\n")


def _zsh(parser):
    lines = []
    for names, value, help_text, choices in _options(parser):
        text = re.sub(r"([\[\]:\\])", r"\\\1", help_text).replace("'", "'\\''")
        argument = f":{value.lower()}:" + (f"({' '.join(choices)})" if choices else "_files") if value else ""
        lines += [f"'{name}[{text}]{argument}'" for name in names]
    return f"#compdef {parser.prog}\n_arguments \\\n  " + " \\\n  ".join([*lines, "'*:file:_files'"]) + "\n"


PAGES = {"markdown": _markdown, "man": _man, "bash": _bash, "zsh": _zsh}
