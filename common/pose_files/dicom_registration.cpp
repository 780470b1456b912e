// SPDX-License-Identifier: Apache-2.0
#include "pose_files/dicom_registration.h"

#include <algorithm>
#include <charconv>
#include <optional>

#include "base/error.h"
#include "base/joined.h"
#include "files/sha256.h"
#include "pose_files/dicom_items.h"

namespace af {
namespace {

using Tag = DicomItem::Tag;

constexpr const char* kSopClass = "1.2.840.10008.5.1.4.1.1.66.1";
constexpr Tag kSopClassTag = {0x0008, 0x0016};
constexpr Tag kFrameOfReference = {0x0020, 0x0052};
constexpr Tag kRegistrationSequence = {0x0070, 0x0308};
constexpr Tag kMatrixRegistrationSequence = {0x0070, 0x0309};
constexpr Tag kMatrixSequence = {0x0070, 0x030a};
constexpr Tag kMatrixType = {0x0070, 0x030c};
constexpr Tag kMatrix = {0x3006, 0x00c6};

/// The 16 numbers of a DS element, separated by backslashes.
Eigen::Matrix4d matrix_of(const std::string& text, const std::string& where) {
  std::string words = text;
  for (char& c : words)
    if (c == '\\') c = ' ';
  const std::vector<double> numbers = numbers_of(words, where);
  constexpr std::size_t kCount = 16;
  if (numbers.size() != kCount)
    throw FileError(where, "numbers of the matrix", "16", std::to_string(numbers.size()));
  return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data());
}

struct RegisteredFrame {
  std::string uid;
  RigidTransform registered_from_frame = RigidTransform::Identity();
  bool has_matrix = false;
};

/// The matrices of an item are applied in their order.
RegisteredFrame frame_of(const DicomItem& item, const std::string& where) {
  RegisteredFrame frame{item.text(kFrameOfReference)};
  for (const DicomItem& registration : item.items(kMatrixRegistrationSequence))
    for (const DicomItem& matrix : registration.items(kMatrixSequence)) {
      if (const std::string type = matrix.text(kMatrixType); type != "RIGID")
        throw InputError("matrix type", type, "must be RIGID", where);
      frame.registered_from_frame = rigid_or_throw(matrix_of(matrix.text(kMatrix), where), where) *
                                    frame.registered_from_frame;
      frame.has_matrix = true;
    }
  return frame;
}

std::string uids_of(const std::vector<RegisteredFrame>& frames) {
  return joined(frames, ", ", [](const RegisteredFrame& frame) {
    return frame.uid.empty() ? "one without UID" : frame.uid;
  });
}

/// The frames of a pose; null: the frame that the object registers to, if it does not list it.
struct PoseFrames {
  const RegisteredFrame* ct = nullptr;
  const RegisteredFrame* room = nullptr;

  [[nodiscard]] RigidTransform room_from_ct() const {
    const auto matrix = [](const RegisteredFrame* frame) {
      return frame == nullptr ? RigidTransform::Identity() : frame->registered_from_frame;
    };
    return matrix(room).inverse() * matrix(ct);
  }
};

/// The object's own frame is the room's, or the CT's: then the only other one is the room's.
PoseFrames pose_frames(const std::vector<RegisteredFrame>& frames,
                       const std::string& own_uid,
                       const std::string& ct_uid,
                       const std::string& file) {
  std::vector<const RegisteredFrame*> others;
  const RegisteredFrame* own = nullptr;
  const RegisteredFrame* ct = nullptr;
  for (const RegisteredFrame& frame : frames) {
    if (frame.uid == own_uid) own = &frame;
    if (!ct_uid.empty() && frame.uid == ct_uid) ct = &frame;
    if (frame.uid != own_uid && frame.uid != ct_uid) others.push_back(&frame);
  }
  if (!ct_uid.empty() && ct_uid == own_uid) {
    if (others.size() > 1)
      throw InputError(file + ": its own frame of reference is the CT's (" + ct_uid +
                       "); which is the room's is not known: it has " + uids_of(frames));
    return {ct, others.empty() ? nullptr : others.front()};
  }
  if (ct != nullptr) return {ct, own};
  if (others.size() == 1) return {others.front(), own};
  if (frames.size() == 1) return {own, nullptr};
  throw InputError(file + ": which frame of reference is the CT's is not known; it has " +
                   uids_of(frames));
}

/// Every frame once, and all but the object's own with a matrix.
void check_frames(const std::vector<RegisteredFrame>& frames,
                  const std::string& own_uid,
                  const std::string& file) {
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!frames[i].has_matrix && frames[i].uid != own_uid)
      throw FileError(file, "has no matrix of the frame of reference " + frames[i].uid);
    for (std::size_t j = 0; j < i; ++j)
      if (frames[i].uid == frames[j].uid)
        throw InputError(file + ": registers a frame of reference twice; it has " +
                         uids_of(frames));
  }
}

/// A UID of 120 bits of a hash (PS3.5, B.2), so that equal content has an equal UID.
std::string uid_of(const std::string& content) {
  const std::string hash = sha256_hex(std::as_bytes(std::span(content)));
  std::string decimal = "0";  // of the first 30 hexadecimal digits
  for (const char digit : hash.substr(0, 30)) {
    int carry = digit <= '9' ? digit - '0' : digit - 'a' + 10;
    for (std::size_t i = decimal.size(); i-- > 0;) {
      const int value = (decimal[i] - '0') * 16 + carry;
      decimal[i] = static_cast<char>('0' + value % 10);
      carry = value / 10;
    }
    for (; carry > 0; carry /= 10) decimal.insert(0, 1, static_cast<char>('0' + carry % 10));
  }
  return "2.25." + decimal.substr(std::min(decimal.find_first_not_of('0'), decimal.size() - 1));
}

/// A decimal string of at most 16 characters (PS3.5, 6.2): 1e-9 of a rotation, 1e-7 mm or better.
std::string decimal_string(double value) {
  constexpr std::size_t kMost = 16;
  for (int digits = 17; digits > 6; --digits) {
    char buffer[64];
    const auto [end, error] = std::to_chars(
        buffer, buffer + sizeof(buffer), value + 0.0, std::chars_format::general, digits);
    if (error == std::errc() && static_cast<std::size_t>(end - buffer) <= kMost)
      return {buffer, end};
  }
  return "0";
}

std::string matrix_text(const RigidTransform& transform) {
  std::string text;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column)
      text += (row + column == 0 ? "" : "\\") + decimal_string(transform.matrix()(row, column));
  return text;
}

DicomElementToWrite sequence_of(Tag tag, std::vector<std::vector<DicomElementToWrite>> items) {
  return {tag, "SQ", "", std::move(items)};
}

std::vector<DicomElementToWrite> registration_item(const std::string& uid,
                                                   const RigidTransform& registered_from_frame) {
  const std::vector<DicomElementToWrite> matrix = {
      {kMatrix, "DS", matrix_text(registered_from_frame), {}}, {kMatrixType, "CS", "RIGID", {}}};
  // In ascending order of tags: (0070,030C) stands before (3006,00C6).
  return {{kFrameOfReference, "UI", uid, {}},
          sequence_of(kMatrixRegistrationSequence,
                      {{sequence_of(kMatrixSequence, {{matrix[1], matrix[0]}}),
                        sequence_of({0x0070, 0x030d}, {})}})};
}

}  // namespace

bool is_dicom_registration(const PoseFileBytes& file) {
  return is_dicom_bytes(file.bytes);
}

bool holds_dicom_registration(const PoseFileBytes& file) {
  // The UID stands at the beginning, in group 0002 and 0008; a damaged one is refused by reading.
  constexpr std::size_t kBeginning = 2048;
  return is_dicom_bytes(file.bytes) &&
         file.bytes.substr(0, kBeginning).find(kSopClass) != std::string::npos;
}

PosesInFile read_dicom_registration(const PoseFileBytes& file, const PoseContext& context) {
  const std::string name = file.path.string();
  constexpr std::size_t kMostBytes = std::size_t{16} << 20;
  if (file.bytes.size() > kMostBytes)
    throw InputError(name + ": DICOM, but too large to be a spatial registration");
  const DicomItem object = dicom_item_of_bytes(file.bytes, name);
  if (object.text(kSopClassTag) != kSopClass)
    throw InputError("SOP class",
                     object.text(kSopClassTag),
                     std::string("must be ") + kSopClass + ", a spatial registration",
                     name);
  const std::string own_uid = object.text(kFrameOfReference);
  std::vector<RegisteredFrame> frames;
  for (const DicomItem& item : object.items(kRegistrationSequence))
    frames.push_back(frame_of(item, name));
  if (frames.empty()) throw FileError(name, "has no registration (0070,0308)");
  const std::string ct_uid =
      context.ct_frame_of_reference ? context.ct_frame_of_reference() : std::string();
  check_frames(frames, own_uid, name);
  const PoseFrames pose = pose_frames(frames, own_uid, ct_uid, name);
  PosesInFile found{{{1, pose.room_from_ct()}}, {}};
  if (ct_uid.empty() || (pose.ct != nullptr && pose.ct->uid != ct_uid))
    found.notes.push_back(name + ": the frame of reference " + pose.ct->uid +
                          " is taken as the CT's, " +
                          (ct_uid.empty() ? "whose own is not known (--ct or --study states it)"
                                          : "which is " + ct_uid));
  for (const RegisteredFrame& frame : frames)
    if (&frame != pose.ct && &frame != pose.room)
      found.notes.push_back(name + ": the matrix of the frame of reference " + frame.uid +
                            " is not read: it is neither the CT's nor the object's own");
  return found;
}

std::string write_dicom_registration(std::span<const RigidTransform> room_from_ct,
                                     const PoseContext& context) {
  const RigidTransform& pose = only_pose(room_from_ct, "dicom");
  const std::string matrix = matrix_text(pose);
  std::string ct_uid =
      context.ct_frame_of_reference ? context.ct_frame_of_reference() : std::string();
  if (ct_uid.empty()) ct_uid = uid_of("ct " + matrix);
  const std::string room_uid = uid_of("room " + matrix);
  const std::string instance_uid = uid_of("instance " + ct_uid + matrix);
  const std::vector<DicomElementToWrite> elements = {
      {kSopClassTag, "UI", kSopClass, {}},
      {{0x0008, 0x0018}, "UI", instance_uid, {}},
      {{0x0008, 0x0020}, "DA", "", {}},
      {{0x0008, 0x0023}, "DA", "19700101", {}},
      {{0x0008, 0x0030}, "TM", "", {}},
      {{0x0008, 0x0033}, "TM", "000000", {}},
      {{0x0008, 0x0050}, "SH", "", {}},
      {{0x0008, 0x0060}, "CS", "REG", {}},
      {{0x0008, 0x0070}, "LO", "attenuation fields", {}},
      {{0x0008, 0x0090}, "PN", "", {}},
      {{0x0010, 0x0010}, "PN", "", {}},
      {{0x0010, 0x0020}, "LO", "", {}},
      {{0x0010, 0x0030}, "DA", "", {}},
      {{0x0010, 0x0040}, "CS", "", {}},
      {{0x0020, 0x000d}, "UI", uid_of("study " + ct_uid), {}},
      {{0x0020, 0x000e}, "UI", uid_of("series " + ct_uid), {}},
      {{0x0020, 0x0010}, "SH", "", {}},
      {{0x0020, 0x0011}, "IS", "1", {}},
      {{0x0020, 0x0013}, "IS", "1", {}},
      {kFrameOfReference, "UI", room_uid, {}},
      {{0x0020, 0x1040}, "LO", "", {}},
      {{0x0070, 0x0080}, "CS", "ROOM_FROM_CT", {}},
      {{0x0070, 0x0081}, "LO", "x_room = M x_ct", {}},
      {{0x0070, 0x0084}, "PN", "", {}},
      sequence_of(kRegistrationSequence,
                  {registration_item(room_uid, RigidTransform::Identity()),
                   registration_item(ct_uid, pose)}),
  };
  return dicom_file_bytes(elements, kSopClass, instance_uid);
}

}  // namespace af
