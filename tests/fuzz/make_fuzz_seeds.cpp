// SPDX-License-Identifier: Apache-2.0
// Writes small inputs for the fuzzers to begin with, one folder per fuzzer: what our own programs
// and tests write, and former findings (a line of hexadecimal digits in findings/NAME.txt for
// each).
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <regex>
#include <stdexcept>
#include <string>

#include "base/error.h"
#include "base/stored_bytes.h"
#include "ct/ct_reader.h"
#include "ct/ct_volume.h"
#include "evaluate/registration/registration_rows.h"
#include "files/output_file.h"
#include "study/pose_file.h"
#include "study/rig_file.h"
#include "study/study_template.h"
#include "unit/ct/ct_test_data.h"
#include "unit/ct/dicom_test_file.h"
#include "xray/image_file.h"

namespace {

namespace fs = std::filesystem;
using namespace af;
using namespace std::string_literals;

void write_seed(const fs::path& path, const std::string& bytes) {
  fs::create_directories(path.parent_path());
  std::ofstream file(path, std::ios::binary);
  file << bytes;
  if (!file.flush()) throw std::runtime_error("cannot write " + path.string());
}

RigidTransform some_pose() {
  return pose_from_parameters(PoseFrame(), PoseParameters::from_deg_and_mm({1, -2, 3, 4, 5, -6}));
}

/// A template with its optional keys, which are commented out by "# ".
std::string uncommented(std::string text) {
  for (std::size_t at = text.find("\n# "); at != std::string::npos;
       at = text.find("\n# ", at + 1)) {
    const std::size_t end = text.find('\n', at + 1);
    if (text.substr(at, end - at).find(" = ") != std::string::npos) text.erase(at + 1, 2);
  }
  return text;
}

void write_toml_seeds(const fs::path& folder) {
  for (const std::string& name : builtin_rig_names())
    write_seed(folder / "rig" / name, builtin_rig_text(name));
  write_seed(folder / "rig" / "matrix",
             "isocenter_point = [0, 0, 0]\n[[camera]]\nname = \"A\"\nsize_px = [9, 9]\n"
             "pixel_spacing_mm = [1, 1]\n"
             "projection_matrix = [[4, 1000, 0, 4000], [4, 0, 1000, 4000], [1, 0, 0, 600]]\n");
  write_seed(folder / "rig" / "template", template_text("rig"));
  CameraRig lens = parse_rig(builtin_rig_text("c-arm-12in"), "rig");
  lens.cameras[0].distortion = {{-0.35, 0.12, 0.004, -0.003, 0.05}};
  lens.cameras[1].distortion = {{0.3, -0.1, 0.002, 0.001, 0.02, 0.5, 0.1, -0.05}};
  write_seed(folder / "rig" / "distortion", rig_to_toml(lens));
  write_seed(folder / "study" / "template", template_text("study"));
  const std::string scan =
      "name = \"s\"\nsource_to_axis_mm = 300.0\naxis_to_detector_mm = 150\n"
      "pixel_spacing_mm = [0.4, 0.4]\nsize_px = [64, 64]\nrotation_axis = \"columns\"\n"
      "view_count = 36\nfirst_angle_deg = 5.0\nstep_deg = -10.0\nfiles = \"p{:03}.png\"\n"
      "first_index = 1\n";
  write_seed(folder / "scan" / "intensity",
             scan + "xray_domain = \"intensity\"\ndark = \"d.png\"\nflat = \"f.png\"\n");
  write_seed(folder / "scan" / "level", scan + "xray_domain = \"intensity\"\ndark_level = 8500\n");
  write_seed(folder / "scan" / "attenuation", scan + "xray_domain = \"attenuation\"\n");
  const std::string optional = uncommented(template_text("study"));
  write_seed(folder / "study" / "optional", optional);
  write_seed(
      folder / "study" / "hidden-points",
      std::regex_replace(
          optional, std::regex("(fiducials|landmarks)_px = \\[\\[[^\\]]*\\]"), "$1_px = [[]"));
}

/// An enhanced XA file of two frames.
test::DicomTestFile enhanced_seed(test::DicomTestFile file) {
  test::DicomTestFile geometry;
  geometry.set_text({0x0018, 0x1110}, "DS", "1200");
  geometry.set_float({0x0018, 0x9402}, 800.0f);
  test::DicomTestFile angles;
  angles.set_text({0x0018, 0x1510}, "DS", "30");
  angles.set_text({0x0018, 0x1511}, "DS", "-20");
  test::DicomTestFile pixels;
  pixels.set_text({0x0018, 0x1164}, "DS", "0.4\\0.4");
  test::DicomTestFile shared;
  shared.set_items({0x0018, 0x9476}, {geometry}, true);
  test::DicomTestFile frame;
  frame.set_items({0x0018, 0x9405}, {angles});
  frame.set_items({0x0028, 0x9443}, {pixels});
  file.set_items({0x5200, 0x9229}, {shared});
  file.set_items({0x5200, 0x9230}, {frame, frame}, true);
  return file;
}

void write_table_seeds(const fs::path& folder) {
  write_seed(folder / "csv" / "parameters",
             "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\r\n1,-2,3e0,0.5,+4,\"5\"\r\n");
  write_seed(folder / "csv" / "matrix",
             "case,start_index,m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23\n"
             "skull-01,0,1,0,0,0,0,1,0,0,0,0,1,0\n\"a \"\"b\"\"\n,\",1,1,0,0,9,0,1,0,9,0,0,1,9\n");
  write_seed(folder / "csv" / "found",
             "case,start_index,final_rx_deg,final_ry_deg,final_rz_deg,final_tx_mm,final_ty_mm,"
             "final_tz_mm,seconds\nskull-01,0,0,0,0,nan,0,0,1\nskull-01,1,0,0,0,1,2,3,0.5\n");
  write_seed(folder / "csv" / "starts",
             "start_index,start_rx_deg,start_ry_deg,start_rz_deg,start_tx_mm,start_ty_mm,"
             "start_tz_mm\n0,0,0,0,0,0,0\n1,1,2,3,4,5,6\n");
}

void write_pose_seeds(const fs::path& folder) {
  write_seed(folder / "pose" / "toml", "\1"s + pose_to_toml(some_pose()));
  write_seed(folder / "pose" / "affine", "\2"s + pose_to_itk_transform(some_pose()));
  write_seed(folder / "pose" / "versor",
             "\2#Insight Transform File V1.0\nTransform: VersorRigid3DTransform_double_3_3\n"
             "Parameters: 0.1 0 0.2 1 2 3\nFixedParameters: 0 0 1\n"s);
  write_seed(folder / "pose" / "csv", "\0rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n1,2,3,4,5,6\n"s);
  write_seed(folder / "pose" / "euler",
             "\2#Insight\nTransform: Euler3DTransform_double_3_3\nParameters: 0.1 0.2 0.3 4 5 6\n"
             "FixedParameters: 10 20 30 1\n"s);
  write_seed(folder / "pose" / "json",
             "\3{\"room_from_ct\": [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]], \"a\": [null]}"s);
}

/// "Files of one pose each": kind of their names, length, bytes.
std::string found_poses_input(const std::vector<std::pair<char, std::string>>& files) {
  std::string input(1, '\0');
  for (const auto& [name, bytes] : files) {
    const std::size_t length = bytes.size();
    input += std::string{name, '\0'} + static_cast<char>(length & 0xffu) +
             static_cast<char>(length >> 8u & 0xffu) + bytes;
  }
  return input;
}

void write_found_poses_seeds(const fs::path& folder) {
  const RigidTransform pose = some_pose();
  const std::string plain = "1 0 0 5\n0 1 0 6, 0 0 1 7\n0 0 0 1\n";
  const std::string json =
      "{\"room_from_ct\": [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]], \"views\": [null]}";
  const std::string film = "1,0,0,-1,0,1,0,15,0,0,1,-10,0,0,0,1\n";
  const auto seed = [&](const char* name, const std::string& input) {
    write_seed(folder / "found_poses" / name, input);
  };
  seed("transforms", found_poses_input({{0, pose_to_itk_transform(pose)}, {3, plain}}));
  seed("of-a-case", found_poses_input({{1, json}, {2, pose_to_toml(pose)}, {4, film}}));
  seed("names", found_poses_input({{7, plain}, {8, plain}, {9, pose_to_toml(pose)}}));
}

/// "Options, number of changes, and for each: slice, element, length, value", 70 bytes a change.
void write_dicom_ct_seeds(const fs::path& folder) {
  const auto seed = [&](const char* name, char options, const std::vector<std::string>& changes) {
    std::string input = std::string{options, static_cast<char>(changes.size()), '\0'};
    for (std::string change : changes) {
      constexpr std::size_t kSliceBytes = 2;
      change.resize(kSliceBytes + 70, '\0');
      input += change;
    }
    write_seed(folder / "dicom_ct" / name, input);
  };
  const auto position = [](char slice, const std::string& text) {
    return std::string{slice, '\0', '\0', '\0', static_cast<char>(text.size())} + text;
  };
  seed("sound", '\0', {});
  seed("body", '\2', {});
  seed("labels", '\x10', {});
  seed("raw", '\x08', {});
  seed("uneven", '\1', {position(2, "-3\\2\\-6.5")});
  seed("tilted",
       '\1',
       {position(1, "-3\\2.2\\-8.5"), position(2, "-3\\2.4\\-7"), position(3, "-3\\2.6\\-5.5")});
  seed("another-series",
       '\x20',
       {std::string("\1\0\x0a\0\5"
                    "1.2.3",
                    10)});
}

/// An input for af-inspect: the kind of file name, then the content.
void write_inspect_seeds(const fs::path& folder) {
  const auto seed = [&](const char* name, char kind, const std::string& bytes) {
    write_seed(folder / "inspect" / name, kind + bytes);
  };
  seed("rig", '\0', builtin_rig_text("c-arm-12in"));
  seed("study", '\2', template_text("study"));
  seed("pose", '\0', pose_to_toml(some_pose()));
  seed("transform", '\0', pose_to_itk_transform(some_pose()));
  seed("matrix", '\0', "1 0 0 5\n0 1 0 6\n0 0 1 7\n0 0 0 1\n");
  seed("film", '\4', "1,0,0,-1,0,1,0,15,0,0,1,-10,0,0,0,1\n");
  seed("result",
       '\3',
       "{\"format\": \"attenuation-fields result\", \"format_version\": 1, \"room_from_ct\": "
       "[[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]], \"list\": [1, \"\\u00e9\", {}], \"x\": 1e3}");
  seed("poses", '\1', "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n1,-2,3,0.5,4,5\n");
  seed("registrations",
       '\1',
       "case,start_index,renderer,tre_mm,stop_reason\na,0,field,nan,step-below-final\n");
  seed("image-quality", '\1', "pose_index,psnr_db\n0,inf\n1,41.5\n");
  const fs::path scratch = folder / "inspect.mha";
  write_ct(test::asymmetric_ct(test::small_grid()), scratch);
  seed("ct", '\0', read_text_file(scratch));
  fs::remove(scratch);
  const fs::path image = folder / "inspect.nrrd";
  Image2d xray(5, 4);
  xray.at(2, 1) = 7.0f;
  write_image(xray, image, 1.0, 1.0);
  seed("xray", '\0', read_text_file(image));
  fs::remove(image);
  seed("matrices",
       '\0',
       "# isocenter_point 0 0 0\n# camera A\n# size_px 9 9\n# pixel_spacing_mm 1 1\n"
       "100 4 0 800\n0 4 -100 800\n0 1 0 200\n");
}

void write_image_seeds(const fs::path& folder) {
  fs::create_directories(folder / "image");
  CtGrid grid = test::small_grid();
  const CtVolume ct = test::asymmetric_ct(grid);
  for (const char* name : {"ct.mha", "ct.nrrd", "ct.nii.gz"}) write_ct(ct, folder / "image" / name);
  Image2d image(5, 4);
  image.at(2, 1) = 7.0f;
  write_image_u16(image, folder / "image" / "xray.png", 1.0, 1.0);
  write_image(image, folder / "image" / "xray.mha", 1.0, 1.0);
  write_image(image, folder / "image" / "xray.tif", 1.0, 1.0);
  write_image(image, folder / "image" / "xray.tif", 1.0, 1.0);
  write_seed(folder / "image" / "detached.mhd",
             "NDims = 2\nDimSize = 4 4\nElementType = MET_UCHAR\nElementSpacing = 1 1\n"
             "HeaderSize = -1\nElementDataFile = image\n");
  write_seed(folder / "image" / "detached.nhdr",
             "NRRD0004\ntype: short\ndimension: 2\nsizes: 4 4\nencoding: raw\nendian: little\n"
             "byte skip: -1\ndata file: image\n");
}

void write_dicom_seeds(const fs::path& folder) {
  fs::create_directories(folder / "dicom");
  test::write_dicom_series(test::asymmetric_ct(test::small_grid()), folder / "dicom");
  test::DicomTestFile encoded;
  encoded.set_text({0x0008, 0x0060}, "CS", "CT");
  encoded.set_fragment("1.2.840.10008.1.2.4.70", "not a stream");
  encoded.write(folder / "dicom" / "encoded");
  // A file without header, with implicit types and a sequence of undefined length.
  write_seed(folder / "dicom" / "implicit",
             "\x08\0\x60\0\2\0\0\0CT\x08\0\x40\x11\xff\xff\xff\xff\xfe\xff\0\xe0\xff\xff\xff\xff"
             "\x08\0\x50\x11\2\0\0\0"
             "12\xfe\xff\x0d\xe0\0\0\0\0\xfe\xff\xdd\xe0\0\0\0\0"
             "\x28\0\x10\0\2\0\0\0\1\0\x28\0\x11\0\2\0\0\0\1\0\xe0\x7f\x10\0\2\0\0\0\1\1"s);
}

/// The first byte says how the study reads the file.
void write_dicom_xray_seeds(const fs::path& folder) {
  const fs::path scratch = folder / "dicom_xray.tmp";
  std::vector<int> levels(12 * 12, 3000);
  for (std::size_t i = 0; i < levels.size(); ++i)
    if (i % 12 < 2 || i / 12 > 9) levels[i] = 10;
  const auto write = [&](const std::string& name, char choice, test::DicomTestFile file) {
    file.write(scratch);
    std::ifstream written(scratch, std::ios::binary);
    write_seed(folder / "dicom_xray" / name,
               choice + std::string(std::istreambuf_iterator<char>(written), {}));
    fs::remove(scratch);
  };
  write("plain", '\x22', test::xa_file(12, 12, 1, levels));
  write("frames", '\x61', test::xa_file(12, 12, 3, levels));
  test::DicomTestFile inverted = test::xa_file(12, 12, 1, levels);
  inverted.set_text({0x0028, 0x0004}, "CS", "MONOCHROME1");
  inverted.set_text({0x0028, 0x1041}, "SS", "\xff\xff");
  inverted.set_text({0x0028, 0x1040}, "CS", "LOG");
  inverted.set_text({0x0028, 0x1052}, "DS", "-5");
  inverted.set_text({0x0028, 0x1053}, "DS", "0.5");
  write("inverted", '\x3a', inverted);
  write("attenuation", '\x24', inverted);
  write("enhanced", '\x21', enhanced_seed(test::xa_file(12, 12, 2, levels)));
  std::vector<std::uint16_t> entries;
  for (std::uint16_t i = 0; i < 64; ++i) entries.push_back(static_cast<std::uint16_t>(4000 - i));
  test::DicomTestFile lut;
  lut.set_u16s({0x0028, 0x3002}, {64, 2950, 16});
  lut.set_u16s({0x0028, 0x3006}, entries, "OW");
  test::DicomTestFile with_lut = test::xa_file(12, 12, 1, levels);
  with_lut.set_text({0x0028, 0x1040}, "CS", "LOG");
  with_lut.set_items({0x0028, 0x3000}, {lut}, true);
  write("lut", '\x20', with_lut);
}

void write_other_seeds(const fs::path& folder) {
  write_seed(folder / "journal" / "manifest",
             "\0{\"format\": \"af-progress-journal\", \"format_version\": 4, \"decides\": "
             "{\"seed\": \"1\", \"ct\": \"0123\"}, \"plan\": 0}"s);
  write_seed(folder / "journal" / "records",
             "\1AFRECOR4\1\0\0\0\0\0\0\0\4\0\0\0\0\0\0\0\1\2\3\4\5\6\7\x08"s + "abcd");
  write_seed(folder / "journal" / "damaged",
             "\2\3\0\4\0abcd\0\0\5\0hello\2\0\x15\0\0\x77\x20\0\1\x44"s);
  evaluation::TracedRow traced;
  traced.row.case_name = "skull";
  traced.row.renderer = "field";
  traced.row.stop_reason = "step-below-final";
  traced.trace.push_back({1, 2.0, 13, 0.5, {}, 4.0});
  const auto bytes = bytes_of(traced);
  write_seed(folder / "rows" / "row",
             std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

/// The first byte chooses the field or the file: one for each version of the format, one with a
/// range of bounds, one of bone alone, an atlas (see sound_files() in fuzz_field_file.cpp).
void write_field_seeds(const fs::path& folder) {
  constexpr char kValueKinds = 2;
  for (char kind = 0; kind < kValueKinds; ++kind) {
    const auto seed = [&](const char* name, const std::string& edits) {
      write_seed(folder / "field_values" / (name + std::to_string(kind)), kind + edits);
    };
    seed("sound-", "");
    seed("shifted-", "\2\0\3\0\1\0\0\0\0\0\0\0\x59\x40\5\0\2\0\0\0\x06\0\0\0"s);
  }
  constexpr char kFileKinds = 8;
  for (char kind = 0; kind < kFileKinds; ++kind) {
    const auto seed = [&](const char* name, const std::string& edits) {
      write_seed(folder / "field_file" / (name + std::to_string(kind)), kind + edits);
    };
    seed("sound-", "");
    seed("content-", "\x0a\0\0\0\0\0\6\0\0\0"s);
    seed("replaced-", "\x05\0\2\0\2\0\1\0\2\0\0\0\0\0\1\0\0\0\0\0\0\0\0\0\0\0"s);
    seed("linked-", "\x08\0\3\0\x09\0\0\0\x0a\0\3\0\x0b\0\2\0"s);
  }
}

/// "Run KIND, and run OTHER, changed by EDITS"; each number has two bytes.
std::string report_input(char kind, char other, const std::string& edits = "") {
  return "\0\0"s + kind + "\0"s + other + "\0"s + edits;
}

void write_report_seeds(const fs::path& folder) {
  constexpr char kNoOther = 63;
  for (char kind = 0; kind < 5; ++kind) {
    write_seed(folder / "report" / ("sound-" + std::to_string(kind)), report_input(kind, kNoOther));
    for (char place = 1; place < 40; place = static_cast<char>(place + 13))
      write_seed(folder / "report" / ("changed-" + std::to_string(kind) + std::to_string(place)),
                 report_input(kind, kNoOther, "\0\0\7\0"s + place + "\0\1\0\0\0"s));
  }
  write_seed(folder / "report" / "two-registrations", report_input(0, 5));
  write_seed(folder / "report" / "two-image-qualities", report_input(1, 6));
  write_seed(folder / "report" / "table", report_input(0, kNoOther, "\0\0\0\0\x66\1\0\0\1\0"s));
  write_seed(folder / "report" / "raw",
             "\1\0\0\0\x3f\0"s +
                 "{\"format\": \"attenuation-fields evaluation\", \"format_version\": 1, \"kind\": "
                 "\"registration\", \"provenance\": {}, \"renderers\": [{}], \"cases\": []}");
}

void write_shard_seeds(const fs::path& folder) {
  write_seed(folder / "shards" / "manifest",
             "\0\0{\"format\": \"af-progress-journal\", \"format_version\": 4, \"decides\": "
             "{\"step_mm\": \"3\", \"ct\": \"b\"}, \"plan\": 1000}"s);
  write_seed(folder / "shards" / "sound",
             "\1\0\1\0\2\0\3\0\x11\1\1\0\2\0\1\0\0\0\2\0\1\0\5\0\x11\1\0\0"s);
  write_seed(folder / "shards" / "damaged",
             "\1\0\1\0\0\0\2\0\0\0\1\0\0\0\2\0\0\0\1\0\0\0\2\0\0\0\1\0\x30\0\1\x77"s);
  write_seed(folder / "shards" / "training",
             "\2\0\x08\0\0\0\0\0\0\0\0\0\4\0\0\0\0\1\0\0\2\0\0\3\0\0\1\0"s);
  write_seed(folder / "shards" / "codebook", "\3\0"s + std::string(64, '\0'));
  write_seed(folder / "shards" / "forged",
             "\4\0\0\0\0\0\1\0\0\0\0\0\0\0\2\0\1\0\1\0\1\0\x08\0\x3f\0\0\0\0\0\0\0"s);
  write_seed(folder / "shards" / "names", "\4\0\3\0\0\0\1\0\0\0\0\0\0\0\2\0"s);
}

std::string bytes_of_hex(const std::string& digits) {
  std::string bytes;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2)
    bytes += static_cast<char>(std::stoi(digits.substr(i, 2), nullptr, 16));
  return bytes;
}

void write_findings(const fs::path& findings, const fs::path& folder) {
  for (const auto& entry : fs::directory_iterator(findings)) {
    std::ifstream file(entry.path());
    int number = 0;
    for (std::string line; std::getline(file, line);)
      if (!line.starts_with('#'))
        write_seed(folder / entry.path().stem() / ("finding-" + std::to_string(number++)),
                   bytes_of_hex(line));
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: make_fuzz_seeds FINDINGS FOLDER\n";
    return 2;
  }
  try {
    const fs::path folder = argv[2];
    write_toml_seeds(folder);
    write_table_seeds(folder);
    write_pose_seeds(folder);
    write_image_seeds(folder);
    write_dicom_seeds(folder);
    write_dicom_xray_seeds(folder);
    write_found_poses_seeds(folder);
    write_dicom_ct_seeds(folder);
    write_inspect_seeds(folder);
    write_other_seeds(folder);
    write_field_seeds(folder);
    write_report_seeds(folder);
    write_shard_seeds(folder);
    write_findings(argv[1], folder);
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 1;
  }
  return 0;
}
