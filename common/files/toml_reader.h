// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <toml++/toml.h>
#include <vector>

#include <Eigen/Core>

#include "base/plausible.h"
#include "geometry/rigid_transform.h"

// Internal to common/io: toml++ stays out of every public header.
namespace af {

/// Parses TOML. Throws FileError "FILE:LINE:COLUMN: reason" when it is not TOML, when the text is
/// empty, and when keys are nested so deeply that handling them would exhaust the stack.
toml::table parse_toml(std::string_view text, const std::string& file);
constexpr std::size_t kMostTomlBytes = std::size_t{64} << 20;

/// parse_toml() for a file of at most kMostTomlBytes.
toml::table read_toml_file(const std::filesystem::path& path);

/// Collects everything wrong with one file, so that it is reported all at once.
class TomlProblems {
 public:
  explicit TomlProblems(std::string file) : file_(std::move(file)) {}

  /// "FILE:LINE: message".
  void add(const toml::node& node, const std::string& message);
  [[nodiscard]] std::string where(const toml::node& node) const;
  [[nodiscard]] bool empty() const { return problems_.empty(); }
  /// Throws InputError that lists every problem in the order of the file's lines, if there is any.
  void throw_if_any() const;

 private:
  struct Problem {
    toml::source_index line;
    std::string message;
  };

  std::string file_;
  std::vector<Problem> problems_;
};

enum class Presence { Required, Optional };
/// Whether rows of a matrix may be absent.
enum class RowGaps { Refused, Allowed };

/// Reads one table's keys with type and range checks. Every get_*() notes its key as known. A value
/// that is missing or unacceptable is noted as a problem and comes back as nullopt.
class TomlTableReader {
 public:
  /// `prefix` precedes key names in messages: "case[0]." or empty. Table and problems must outlive
  /// the reader.
  TomlTableReader(const toml::table& table, std::string prefix, TomlProblems& problems)
      : table_(table), prefix_(std::move(prefix)), problems_(problems) {}

  std::optional<std::string> get_string(const char* key, Presence presence);
  /// A finite number.
  std::optional<double> get_number(const char* key, Presence presence);
  /// A whole number that fits an int.
  std::optional<int> get_integer(const char* key, Presence presence);
  /// A list of exactly `Size` numbers within kMaxRoomMm: points, directions, spacings.
  template <int Size>
  std::optional<Eigen::Matrix<double, Size, 1>> get_vector(const char* key, Presence presence) {
    const auto numbers = get_numbers(key, Size, presence);
    if (!numbers) return std::nullopt;
    return Eigen::Map<const Eigen::Matrix<double, Size, 1>>(numbers->data());
  }
  /// A list of any number of numbers within kMaxRoomMm. An empty one is a problem.
  std::optional<std::vector<double>> get_number_list(const char* key, Presence presence);
  /// A list of exactly `count` whole numbers that fit an int.
  std::optional<std::vector<int>> get_integers(const char* key, int count, Presence presence);
  /// A list of rows of `columns` numbers each, finite and within `most`. `rows` = -1: any number of
  /// rows. With `RowGaps::Allowed` a row may be absent, given as `[]` or as `nan` in every column.
  /// It is then NaN.
  std::optional<Eigen::MatrixXd> get_matrix(const char* key,
                                            int rows,
                                            int columns,
                                            Presence presence,
                                            double most = kMaxRoomMm,
                                            RowGaps gaps = RowGaps::Refused);
  /// A rigid 4x4 transform.
  std::optional<RigidTransform> get_pose(const char* key, Presence presence);
  /// The tables of [[key]]; none is a problem when the key is required.
  std::vector<const toml::table*> get_tables(const char* key, Presence presence);

  /// The value of a key, or the table itself when the key is not there.
  [[nodiscard]] const toml::node& node(const char* key) const;
  /// Whether the key is there. Notes it as known.
  bool has(const char* key);
  /// Whether the key is there and holds a number.
  bool has_number(const char* key);
  /// "FILE:LINE: PREFIXkey".
  [[nodiscard]] std::string place(const char* key) const;
  /// "FILE:LINE: PREFIXkey = value: constraint".
  void add_problem(const char* key, const std::string& constraint);
  /// Notes keys that were never asked for, each with the nearest known name. Call it last.
  void refuse_unknown_keys();

 private:
  const toml::node* find(const char* key, Presence presence);
  std::optional<std::vector<double>> get_numbers(const char* key, int count, Presence presence);

  const toml::table& table_;
  std::string prefix_;
  TomlProblems& problems_;
  std::set<std::string> known_keys_;
};

/// A TOML float that reads back to the same double.
std::string toml_number(double value);
/// "[1.0, 2.0]"
std::string toml_numbers(const Eigen::VectorXd& values);
/// "[[1.0, 2.0], [3.0, 4.0]]", row by row.
std::string toml_matrix(const Eigen::MatrixXd& matrix);

}  // namespace af
