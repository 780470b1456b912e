// SPDX-License-Identifier: Apache-2.0
// What pickle and copy need. Values are pickled by their members, and opened or loaded objects by
// their arguments.
#pragma once

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>

#include "attenuation_fields/errors.h"
#include "python/bindings/arrays.h"

namespace attenuation_fields::python {

template <typename Value>
py::object pickled(const Value& value) {
  if constexpr (std::is_same_v<Value, Pose>)
    return py::cast(value.room_from_ct);
  else if constexpr (std::is_base_of_v<py::object, Value>)
    return value;
  else
    return py::cast(value);
}

template <typename Value>
Value unpickled(const py::handle& state) {
  if constexpr (std::is_same_v<Value, Pose>)
    return {state.cast<decltype(Pose::room_from_ct)>()};
  else
    return state.cast<Value>();
}

/// Before protocol 2, pickle would make an object of pybind11's base, which ends the process.
template <typename Class>
void def_protocols(Class& owner) {
  owner.def("__reduce_ex__", [](const py::object& self, int protocol) {
    const py::object object = py::module_::import("builtins").attr("object");
    return object.attr("__reduce_ex__")(self, std::max(protocol, 2));
  });
}

/// Pickles a struct as the tuple of these members.
template <typename Value, typename... Members>
void def_pickle(py::class_<Value>& owner, Members Value::*... members) {
  owner.def(py::pickle([=](const Value& self) { return py::make_tuple(pickled(self.*members)...); },
                       [=](const py::tuple& state) {
                         if (state.size() != sizeof...(members))
                           throw InputError("pickle = of another version: must be of this one");
                         Value value;
                         std::size_t next = 0;
                         ((value.*members = unpickled<Members>(state[next++])), ...);
                         return value;
                       }));
  def_protocols(owner);
}

/// A `Base` with the named arguments from which it was made.
template <typename Base>
struct MadeBy : Base {
  py::dict arguments;
};

/// An argument as another process can use it: its paths do not depend on the working folder.
inline py::object kept_argument(const std::filesystem::path& path) {
  return py::cast(std::filesystem::absolute(path));
}
inline py::object kept_argument(const Numbers& numbers) {
  return numbers.given;
}
template <typename Value>
py::object kept_argument(const Value& value) {
  return py::cast(value);
}
template <typename Other>
py::object kept_argument(
    const std::map<std::string, std::variant<std::filesystem::path, Other>>& by_name) {
  py::dict kept;
  for (const auto& [name, value] : by_name)
    kept[py::str(name)] = std::visit([](const auto& one) { return kept_argument(one); }, value);
  return kept;
}

/// `make`, which also keeps its arguments by these names.
template <typename Made, typename... Arguments>
auto keeping_arguments(Made (*make)(Arguments...),
                       const std::array<const char*, sizeof...(Arguments)>& names) {
  return [make, names](Arguments... arguments) {
    py::dict kept;
    std::size_t next = 0;
    ((kept[names[next++]] = kept_argument(arguments)), ...);
    return MadeBy<Made>{make(arguments...), std::move(kept)};
  };
}

/// Copies of objects that do not change are the object itself.
template <typename Class>
void def_copies(Class& owner) {
  owner.def("__copy__", [](const py::object& self) { return self; });
  owner.def("__deepcopy__", [](const py::object& self, const py::dict& /*memo*/) { return self; });
}

/// pickle calls `maker` of attenuation_fields._made_again with the arguments and these facts.
template <typename Made, typename... Bases, typename... Facts>
void def_made_again(py::class_<MadeBy<Made>, Bases...>& owner, const char* maker, Facts... facts) {
  owner.def("__reduce__", [=](const MadeBy<Made>& self) {
    const py::object make = py::module_::import("attenuation_fields._made_again").attr(maker);
    return py::make_tuple(make, py::make_tuple(self.arguments, (self.*facts)()...));
  });
}

}  // namespace attenuation_fields::python
