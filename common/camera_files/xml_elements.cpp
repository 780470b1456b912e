// SPDX-License-Identifier: Apache-2.0
#include "camera_files/xml_elements.h"

#include <expat.h>
#include <memory>

#include "base/error.h"

namespace af {

namespace {

constexpr std::size_t kMostElements = 1000000;
constexpr std::size_t kDeepest = 32;

/// What expat's handlers build. They must not throw through expat, which is C.
struct XmlBuilder {
  XML_Parser parser = nullptr;
  XmlElement document;
  std::vector<XmlElement> open;
  std::size_t count = 0;
  std::string problem;

  void stop(const char* what) {
    problem = what;
    XML_StopParser(parser, XML_FALSE);
  }
};

XmlBuilder& builder(void* data) {
  return *static_cast<XmlBuilder*>(data);
}

void XMLCALL begin_element(void* data, const XML_Char* name, const XML_Char** attributes) {
  XmlBuilder& xml = builder(data);
  if (++xml.count > kMostElements) return xml.stop("more than a million elements");
  if (xml.open.size() == kDeepest) return xml.stop("elements are nested too deeply");
  xml.open.push_back({name, XML_GetCurrentLineNumber(xml.parser), {}, "", {}});
  for (; *attributes != nullptr; attributes += 2)
    xml.open.back().attributes.emplace(attributes[0], attributes[1]);
}

void XMLCALL end_element(void* data, const XML_Char* /*name*/) {
  XmlBuilder& xml = builder(data);
  XmlElement done = std::move(xml.open.back());
  xml.open.pop_back();
  (xml.open.empty() ? xml.document : xml.open.back()).children.push_back(std::move(done));
}

void XMLCALL take_text(void* data, const XML_Char* text, int length) {
  XmlBuilder& xml = builder(data);
  if (!xml.open.empty()) xml.open.back().text.append(text, static_cast<std::size_t>(length));
}

void XMLCALL refuse_entity(void* data,
                           const XML_Char* /*name*/,
                           int /*is_parameter*/,
                           const XML_Char* /*value*/,
                           int /*length*/,
                           const XML_Char* /*base*/,
                           const XML_Char* /*system*/,
                           const XML_Char* /*public_id*/,
                           const XML_Char* /*notation*/) {
  builder(data).stop("it declares entities");
}

}  // namespace

XmlElement parse_xml(const std::string& text, const std::string& file) {
  const std::unique_ptr<XML_ParserStruct, decltype(&XML_ParserFree)> parser(
      XML_ParserCreate(nullptr), &XML_ParserFree);
  if (!parser) throw FileError(file, "no memory to parse XML");
  XmlBuilder xml;
  xml.parser = parser.get();
  XML_SetUserData(parser.get(), &xml);
  XML_SetElementHandler(parser.get(), begin_element, end_element);
  XML_SetCharacterDataHandler(parser.get(), take_text);
  XML_SetEntityDeclHandler(parser.get(), refuse_entity);
  // CameraFile holds at most kMostTextBytes, so that the length fits an int.
  const auto status =
      XML_Parse(parser.get(), text.data(), static_cast<int>(text.size()), /*isFinal=*/1);
  if (status == XML_STATUS_ERROR || xml.document.children.empty()) {
    const std::string what =
        xml.problem.empty() ? XML_ErrorString(XML_GetErrorCode(parser.get())) : xml.problem;
    throw FileError(file + ":" + std::to_string(XML_GetCurrentLineNumber(parser.get())),
                    "broken XML: " + what);
  }
  return std::move(xml.document.children.front());
}

}  // namespace af
