// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

namespace af {

/// An element of an XML text: its own text without that of its children.
struct XmlElement {
  std::string name;
  std::size_t line = 0;
  std::map<std::string, std::string> attributes;
  std::string text;
  std::vector<XmlElement> children;
};

/// The root element (expat). FileError "FILE:LINE: ..." when the text is
/// no XML, and for elements nested deeper than 32, a million elements or entities of its own.
XmlElement parse_xml(const std::string& text, const std::string& file);

}  // namespace af
