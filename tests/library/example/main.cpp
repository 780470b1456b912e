// SPDX-License-Identifier: Apache-2.0
// example FIELD.af.h5 OUT.f32: looks up a DRR, writes its pixels as they are in memory, and says
// how it changes with the pose. Errors have the text and the exit codes of the programs.
#include <attenuation_fields/attenuation_fields.h>
#include <cstddef>
#include <exception>
#include <fstream>
#include <iostream>
#include <vector>

namespace {

void look_up(const char* field_path, const char* output_path) {
  using namespace attenuation_fields;
  const Field field = Field::open(field_path);
  const Pose pose = field.frame().pose({2.0, -1.5, 3.0}, {4.0, -5.0, 6.0});
  std::vector<float> drr(field.pixel_count());
  field.drr(pose, drr);
  std::ofstream(output_path, std::ios::binary)
      .write(reinterpret_cast<const char*>(drr.data()),
             static_cast<std::streamsize>(drr.size() * sizeof(float)));

  std::vector<float> planes(6 * drr.size());
  field.drr_and_gradient({2.0, -1.5, 3.0}, {4.0, -5.0, 6.0}, drr, planes);
  std::cout << "attenuation_fields " << version() << ": " << field.width() << " x "
            << field.height() << " pixels of camera '" << field.camera().name
            << "'; the mean changes per degree and mm by";
  for (std::size_t k = 0; k < 6; ++k) {
    double sum = 0.0;
    for (std::size_t i = 0; i < drr.size(); ++i)
      sum += static_cast<double>(planes[k * drr.size() + i]);
    std::cout << ' ' << sum / static_cast<double>(drr.size());
  }
  std::cout << '\n';
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: example FIELD.af.h5 OUT.f32\n";
    return 2;
  }
  try {
    look_up(argv[1], argv[2]);
    return 0;
  } catch (const attenuation_fields::Error& error) {
    std::cerr << "example: " << error.what() << '\n';
    return error.exit_code();
  } catch (const std::exception& error) {
    std::cerr << "example: " << error.what() << '\n';
    return 6;
  }
}
