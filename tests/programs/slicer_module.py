#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Reads a program's --xml as 3D Slicer does, checks it, and starts the program as Slicer would.

Usage: slicer_module.py PROGRAM --check
       slicer_module.py PROGRAM --every-option       runs it with a value for every option
       slicer_module.py PROGRAM [NAME=VALUE ...]     runs it as a user who fills in these values

The rules are those of Slicer's execution model: its schema (ModuleDescription.xsd) and its parser
(ModuleDescriptionParser). Where these differ, the parser decides. So the parser's file-like
parameters with a flag are right, although the schema does not know them.
"""
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

HEAD = ["category", "title", "description", "version", "documentation-url", "license", "contributor"]
NUMBERS = {"integer", "double"}
VECTORS = {"integer-vector", "double-vector"}
FILES = {"file", "directory", "image", "transform"}
TAGS = NUMBERS | VECTORS | FILES | {"boolean", "string", "string-enumeration"}
CHILDREN = {"name", "flag", "longflag", "description", "label", "default"}
ATTRIBUTES = {"file": {"fileExtensions"}, "image": {"fileExtensions"}, "transform": {"fileExtensions", "type"}}
SAMPLES = {"integer": "3", "double": "0.5", "integer-vector": "1,2,3", "double-vector": "1,2,3"}


def require(condition, text):
    if not condition:
        sys.exit("slicer_module.py: " + text)


def text_of(element, tag):
    child = element.find(tag)
    return "" if child is None or child.text is None else child.text.strip()


def check_parameter(parameter):
    tag = parameter.tag
    require(tag in TAGS, f"<{tag}> is no parameter of Slicer's")
    name = text_of(parameter, "name")
    allowed = set(CHILDREN)
    if tag in FILES:
        allowed.add("channel")
        require(text_of(parameter, "channel") in ("input", "output"), f"{name}: no channel")
    if tag in NUMBERS:
        allowed.add("constraints")
    if tag == "string-enumeration":
        allowed.add("element")
        elements = [child.text for child in parameter.findall("element")]
        require(len(elements) > 1, f"{name}: nothing to choose from")
        require(text_of(parameter, "default") in elements, f"{name}: its default is no choice")
    extra = {child.tag for child in parameter} - allowed
    require(not extra, f"{name}: <{tag}> cannot hold {extra}")
    require(set(parameter.attrib) <= ATTRIBUTES.get(tag, set()), f"{name}: attributes of <{tag}>")
    for child in ("name", "longflag"):
        word = text_of(parameter, child)
        require(re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", word), f"{name}: <{child}> '{word}'")
    require(len(text_of(parameter, "flag")) <= 1, f"{name}: <flag> of several letters")
    require(text_of(parameter, "label"), f"{name}: no label")
    require(text_of(parameter, "description"), f"{name}: no description")
    default = text_of(parameter, "default")
    if tag == "boolean":
        require(default == "false", f"{name}: a flag of a command line is off at first")
    if tag in NUMBERS:
        require(re.fullmatch(r"[+-]?\d+" if tag == "integer" else r"[+-]?\d*\.?\d+", default), f"{name}: '{default}'")
    constraints = parameter.find("constraints")
    if constraints is not None:
        require([c.tag for c in constraints] == ["minimum", "maximum", "step"], f"{name}: constraints")
        low, high, step = (float(c.text) for c in constraints)
        require(low <= float(default) <= high and step > 0, f"{name}: its default breaks its constraints")


def parameters_of(program):
    run = subprocess.run([program, "--xml"], capture_output=True, text=True, check=False)
    require(run.returncode == 0 and run.stderr == "", f"--xml ended with {run.returncode}: {run.stderr}")
    require(run.stdout.startswith("<?xml "), "the first line is no XML declaration")
    root = ElementTree.fromstring(run.stdout)
    require(root.tag == "executable", f"<{root.tag}> is outermost")
    tags = [child.tag for child in root]
    require(tags[: len(HEAD)] == HEAD, f"the head is {tags[: len(HEAD)]}")
    require(set(tags[len(HEAD) :]) == {"parameters"}, "the head is followed by parameters alone")
    parameters = []
    for panel in root.findall("parameters"):
        require([child.tag for child in panel][:2] == ["label", "description"], "a panel's head")
        require(set(panel.attrib) <= {"advanced"}, "a panel's attributes")
        require(len(panel) > 2, f"panel '{text_of(panel, 'label')}' is empty")
        parameters += list(panel)[2:]
    for parameter in parameters:
        check_parameter(parameter)
    for child in ("name", "longflag", "flag"):
        words = [text_of(p, child) for p in parameters if text_of(p, child)]
        require(len(words) == len(set(words)), f"a <{child}> is there twice")
    return parameters


def arguments(parameter, value):
    """The words that vtkSlicerCLIModuleLogic writes. `value` None stands for what the widget shows at first."""
    flag = "--" + text_of(parameter, "longflag")
    if parameter.tag == "boolean":
        return [flag] if value == "true" else []
    if value is None:
        value = text_of(parameter, "default")
    always_given = parameter.tag in NUMBERS or parameter.tag == "string-enumeration"
    return [flag, value] if value or always_given else []


def sample_of(parameter):
    if parameter.tag == "boolean":
        return "true"
    known = text_of(parameter, "default")
    if parameter.tag == "string":
        listed = re.search(r"One of: (\S+)", text_of(parameter, "description"))
        known = listed.group(1).rstrip(".") if listed else known or "1"
    return known or SAMPLES.get(parameter.tag, "nothing.there")  # a file, which need not exist


def main():
    require(len(sys.argv) > 2, __doc__)
    program, words = sys.argv[1], sys.argv[2:]
    parameters = parameters_of(program)
    if words == ["--check"]:
        print(len(parameters), "parameters")
        return 0
    if words == ["--every-option"]:
        values = {text_of(p, "name"): sample_of(p) for p in parameters}
    else:
        values = dict(word.split("=", 1) for word in words)
    command = [program]
    for parameter in parameters:
        command += arguments(parameter, values.pop(text_of(parameter, "name"), None))
    require(not values, f"no parameters are called {list(values)}")
    print(" ".join(command), flush=True)
    return subprocess.run(command, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
