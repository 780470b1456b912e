// SPDX-License-Identifier: Apache-2.0
// make_library_study FOLDER PROGRAMS: a small study with its fields, and what the programs make of
// them: the DRRs and registrations that the library and the Python module must give to the bit.
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include "drr/field_level.h"
#include "drr/field_renderer.h"
#include "field/field_reading.h"
#include "library/library_study.h"
#include "programs/small_study.h"
#include "support/run_program.h"

namespace {

namespace fs = std::filesystem;

void run(const std::string& command) {
  const af::test::ProgramRun result = af::test::run_command(command);
  if (result.exit_code != 0) throw std::runtime_error(command + "\n" + result.output);
}

/// Writes the DRR and its six planes, as the optimisers get them.
void write_motion_gradient(const fs::path& field_path, const fs::path& output) {
  const auto field = af::read_field(field_path, af::Communicator::alone());
  const auto renderer = af::make_field_renderer(field, "linear");
  const af::View view = af::View::whole_detector(field->identity.camera);
  std::vector<float> values(7 * view.pixel_count());
  const std::span<float> all(values);
  const Eigen::Vector3d pivot(af::test::kPivotRoomMm.data());
  const auto workspace = renderer->make_workspace();
  renderer->render(
      af::pose_from_parameters(field->identity.frame,
                               af::PoseParameters::from_deg_and_mm(af::test::kLibraryPose)),
      view,
      *workspace,
      all.first(view.pixel_count()),
      af::PoseGradients{pivot, all.subspan(view.pixel_count())});
  std::ofstream(output, std::ios::binary)
      .write(reinterpret_cast<const char*>(values.data()),
             static_cast<std::streamsize>(values.size() * sizeof(float)));
}

/// Writes the levels of a field as its tiles have them, without a filter, in the order
/// [slab][u][v][t][s].
void write_tile_levels(const fs::path& field_path) {
  auto field = *af::read_field(field_path, af::Communicator::alone());
  field.codebook.filter.reset();
  const af::FieldLevel decoded =
      af::decode_field(std::make_shared<const af::CompressedAttenuationField>(std::move(field)));
  std::ofstream output(field_path.string() + ".levels.u16", std::ios::binary);
  for (const af::FieldLevelSlab& slab : decoded.slabs) {
    const auto levels = std::as_bytes(
        slab.samples.view().first(decoded.viewpoint_count() * slab.samples_per_viewpoint()));
    output.write(reinterpret_cast<const char*>(levels.data()),
                 static_cast<std::streamsize>(levels.size()));
  }
}

void make(const fs::path& folder, const std::string& programs) {
  fs::remove_all(folder);
  fs::create_directories(folder);
  af::test::write_small_study(folder);
  const std::string study = " --study " + (folder / "study.toml").string();
  std::string fields;
  const std::string design =
      " --max-rotation-deg 8 --max-translation-mm 12 --uv-nodes 24 --st-nodes 96"
      " --codewords 1024 -o ";
  for (const std::string camera : {"AP", "LAT"}) {
    const std::string field = (folder / (camera + ".af.h5")).string();
    run(programs + "/af-precompute" + study + " --camera " + camera + design + field);
    fields += " --field " + camera + "=" + field;
  }
  run(programs + "/af-precompute" + study + " --camera AP --material bone" + design +
      (folder / "AP.bone.af.h5").string());
  // This field has what a file may hold beyond that: slabs, means, a tile filter, bounds per axis.
  // Its viewpoints are odd in number, so that the last tiles are padded.
  run(programs + "/af-precompute" + study +
      " --camera AP --preset standard --max-rotation-deg 5 --max-translation-mm 10"
      " --translation-range-mm ty=-8:12 --slabs 2 --uv-nodes 7 --st-nodes 95 --codewords 256 -o " +
      (folder / "AP.standard.af.h5").string());
  for (const char* name : {"AP.af.h5", "AP.standard.af.h5"}) write_tile_levels(folder / name);
  const std::string atlas = (folder / "AP.atlas.af.h5").string();
  run(programs + "/af-precompute" + study + " --camera AP --orbit axis=z,from=-8,to=8,step=8" +
      design + atlas);
  const std::string pose = " --rotation-deg 2,-1.5,3 --translation-mm 4,-5,6 -o ";
  const std::string field = " --field " + (folder / "AP.af.h5").string();
  run(programs + "/af-drr" + field + pose + (folder / "field.mha").string());
  run(programs + "/af-drr" + field + " --look-up cubic" + pose + (folder / "cubic.mha").string());
  run(programs + "/af-drr --ct " + (folder / "ct.nii.gz").string() + " --rig " +
      (folder / "rig.toml").string() + " --camera LAT" + pose + (folder / "cast.mha").string());
  const std::string beam = " --tube-kvp 80 --aluminium-mm 2 --scatter-to-primary 0.2";
  run(programs + "/af-drr" + field + beam + pose + (folder / "field-beam.mha").string());
  run(programs + "/af-drr --ct " + (folder / "ct.nii.gz").string() + " --rig " +
      (folder / "rig.toml").string() + " --camera LAT" + beam + pose +
      (folder / "cast-beam.mha").string());
  // The angle lies between those of two members, so that both are looked up.
  run(programs + "/af-drr --field " + atlas +
      " --rotation-deg 2,-1.5,7 --translation-mm 4,-5,6 -o " + (folder / "atlas.mha").string());
  write_motion_gradient(folder / "AP.af.h5", folder / "motion-gradient.f32");
  const std::string start =
      " --start-rotation-deg -1,0.5,2.5 --start-translation-mm 0.5,1,4 --preset ";
  for (const std::string preset : {"paper", "fast", "robust", "bone"})
    run(programs + "/af-register" + study + fields + start + preset + " -o " +
        (folder / preset).string() + " || test $? -eq 7");  // "not found" is an answer to compare
  const std::string search = " --preset fast --no-pictures --start search";
  run(programs + "/af-register" + study + " --renderer raycast" + search +
      " --search-modes 3 --search-orientations any --search-translation-mm 20,20,20 -o " +
      (folder / "searched").string());
  run(programs + "/af-register" + study + fields + search + " -o " +
      (folder / "searched-fields").string());
  std::ofstream(folder / "starts.csv") << "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n"
                                          "-1,0.5,2.5,0.5,1,4\n"
                                          "1,1,-1,-2,3,-1\n";
  run(programs + "/af-register" + study + fields + " --preset fast --starts " +
      (folder / "starts.csv").string() + " -o " + (folder / "several").string());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: make_library_study FOLDER PROGRAMS\n";
    return 2;
  }
  try {
    make(argv[1], argv[2]);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "make_library_study: " << error.what() << '\n';
    return 1;
  }
}
