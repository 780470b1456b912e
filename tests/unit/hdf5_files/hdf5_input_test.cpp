// SPDX-License-Identifier: Apache-2.0
#include "hdf5_files/hdf5_input.h"

#include <cmath>
#include <csignal>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include "base/error.h"
#include "hdf5_files/hdf5_output.h"
#include "support/io_checks.h"

namespace af {
namespace {

using test::message_of;
using testing::HasSubstr;

std::string some_file() {
  Hdf5Output file;
  file.add_group("/group");
  file.add_numbers("/group/list", {1.0, -2.0, 3.5});
  file.add_matrix("/group/matrix", (Eigen::Matrix2d() << 1, 2, 3, 4).finished());
  file.add_count("/count", 7);
  file.add_scalar("/scalar", 0.25);
  file.add_text("/text", "of any length");
  file.add_fixed_text("/fixed", "of this length");
  file.add_numbers("/many", std::vector<double>(100, 1.0));
  file.add_numbers("/nan", {std::nan("")});
  return file.bytes();
}

TEST(Hdf5Input, ReadsWhatWasWritten) {
  const Hdf5Input file = Hdf5Input::of_bytes(some_file(), "some.h5");
  EXPECT_EQ(file.numbers("/group/list", 3).values, (std::vector<double>{1.0, -2.0, 3.5}));
  const Hdf5Numbers matrix = file.numbers("/group/matrix", 4);
  EXPECT_EQ(matrix.extents, (std::vector<std::size_t>{2, 2}));
  EXPECT_EQ(matrix.values, (std::vector<double>{1.0, 2.0, 3.0, 4.0})) << "row by row";
  EXPECT_EQ(file.numbers("/count", 1).values, std::vector<double>{7.0});
  EXPECT_TRUE(file.numbers("/scalar", 1).extents.empty());
  EXPECT_EQ(file.text("/text"), "of any length");
  EXPECT_EQ(file.text("/fixed"), "of this length");
  EXPECT_TRUE(file.holds("/group/list"));
  EXPECT_FALSE(file.holds("/group/other"));
  EXPECT_FALSE(file.holds("/other/list"));
}

TEST(Hdf5Input, AFileOnTheDiskIsTheSame) {
  const test::ScratchFolder folder;
  test::write_input(folder / "some.h5", some_file());
  const Hdf5Input file = Hdf5Input::of_file(folder / "some.h5");
  EXPECT_EQ(file.numbers("/count", 1).values, std::vector<double>{7.0});
  EXPECT_EQ(file.text("/text"), "of any length");
}

TEST(Hdf5Input, TextsOfOneHeapAreToldApart) {
  Hdf5Output written;
  for (const char* const text : {"one", "two", "three"})
    written.add_text(std::string("/") + text, text);
  const test::ScratchFolder folder;
  test::write_input(folder / "texts.h5", written.bytes());
  const Hdf5Input file = Hdf5Input::of_file(folder / "texts.h5");
  for (const char* const text : {"three", "one", "two", "one"})
    EXPECT_EQ(file.text(std::string("/") + text), text);
}

TEST(Hdf5Input, RefusesWhatIsNotAskedFor) {
  const Hdf5Input file = Hdf5Input::of_bytes(some_file(), "some.h5");
  const auto refusal = [&](const std::string& path, std::size_t most) {
    return message_of<FileError>([&] { (void)file.numbers(path, most); });
  };
  EXPECT_THAT(refusal("/absent/list", 3), HasSubstr("some.h5: has no /absent"));
  EXPECT_THAT(refusal("/many", 99), HasSubstr("/many: is no list of at most 99 numbers"));
  EXPECT_THAT(refusal("/text", 99), HasSubstr("is no list"));
  EXPECT_THAT(refusal("/nan", 1), HasSubstr("not finite"));
  EXPECT_THAT(refusal("/group", 1), HasSubstr("damaged HDF5: H5Dopen2 failed"));
  EXPECT_THAT(message_of<FileError>([&] { (void)file.text("/count"); }), HasSubstr("is no text"));
}

TEST(Hdf5Input, AFileThatEndsHdf5IsAFileError) {
  const auto open = [] { return Hdf5Input::of_bytes(some_file(), "some.h5"); };
  const auto end = [&](int signal) {
    return message_of<FileError>([&] {
      read_distrusted("some.h5", open, [&](const Hdf5Input&) { return std::raise(signal); });
    });
  };
  EXPECT_THAT(end(SIGSEGV), HasSubstr("some.h5: damaged HDF5: a trial of reading it ended by"));
  EXPECT_THAT(end(SIGABRT), HasSubstr("signal 6"));
  const auto count = [](const Hdf5Input& file) {
    return file.numbers("/many", 1000).values.size();
  };
  EXPECT_EQ(read_distrusted("some.h5", open, count), count(open()));
}

/// Files that lead to others, made by HDF5 itself.
class Hdf5Links : public testing::Test {
 protected:
  Hdf5Links() {
    test::write_input(folder_ / "other.h5", some_file());
    const hid_t file =
        H5Fcreate((folder_ / "linked.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    const std::string other = folder_ / "other.h5";
    H5Lcreate_external(other.c_str(), "/scalar", file, "/outside", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_external(other.c_str(), "/group", file, "/folder", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_soft("/elsewhere", file, "/soft", H5P_DEFAULT, H5P_DEFAULT);
    const hsize_t one = 1;
    const hid_t space = H5Screate_simple(1, &one, nullptr);
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_external(creation, other.c_str(), 0, 8);
    H5Dclose(
        H5Dcreate2(file, "/stored", H5T_IEEE_F64LE, space, H5P_DEFAULT, creation, H5P_DEFAULT));
    H5Pclose(creation);
    const hsize_t large = 1U << 20;
    const hid_t space_of_many = H5Screate_simple(1, &large, nullptr);
    const hid_t chunked = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_chunk(chunked, 1, &large);
    H5Dclose(H5Dcreate2(
        file, "/chunked", H5T_IEEE_F64LE, space_of_many, H5P_DEFAULT, chunked, H5P_DEFAULT));
    H5Pclose(chunked);
    const hid_t large_numbers = H5Tcopy(H5T_STD_I64LE);
    H5Tset_size(large_numbers, large);
    H5Dclose(
        H5Dcreate2(file, "/large", large_numbers, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
    H5Tclose(large_numbers);
    H5Sclose(space);
    H5Sclose(space_of_many);
    H5Fclose(file);
  }

  std::string refusal(const std::string& path) {
    const Hdf5Input file = Hdf5Input::of_file(folder_ / "linked.h5");
    return message_of<FileError>([&] { (void)file.numbers(path, 3); });
  }

 private:
  test::ScratchFolder folder_;
};

TEST_F(Hdf5Links, AreNotFollowed) {
  EXPECT_THAT(refusal("/outside"), HasSubstr("a link"));
  EXPECT_THAT(refusal("/folder/list"), HasSubstr("a link"));
  EXPECT_THAT(refusal("/soft"), HasSubstr("a link"));
}

TEST_F(Hdf5Links, ValuesOfOtherFilesAndLargePiecesAreRefused) {
  EXPECT_THAT(refusal("/stored"), HasSubstr("holds the contents of another file"));
  EXPECT_THAT(refusal("/chunked"), HasSubstr("is stored in large pieces"));
  EXPECT_THAT(refusal("/large"), HasSubstr("has numbers of more than 16 bytes each"));
}

// HDF5 1.10 itself would write beyond its memory for such a file.
TEST(Hdf5Input, TextsThatDoNotFitTheirHeapAreRefused) {
  const std::string good = some_file();
  const std::size_t text = good.find("of any length");
  ASSERT_NE(text, std::string::npos);
  const auto refusal = [&](std::size_t at, char value) {
    std::string forged = good;
    forged[at] = value;
    return message_of<FileError>(
        [&] { (void)Hdf5Input::of_bytes(forged, "forged.h5").text("/text"); });
  };
  EXPECT_THAT(refusal(text - 8, '\5'), HasSubstr("its text is not in its heap")) << "too short";
  EXPECT_THAT(refusal(text - 2, '\x60'), HasSubstr("its text is not in its heap")) << "too long";
  EXPECT_THAT(refusal(text - 16, '\x7f'), HasSubstr("its text is not in its heap")) << "another";
  EXPECT_THAT(refusal(good.find("GCOL"), 'X'), HasSubstr("in no heap"));
}

TEST(Hdf5Input, DamagedFilesAreRefusedOrReadWithoutHarm) {
  const std::string good = some_file();
  const std::size_t refused =
      test::refused_damaged_copies(good, good.size() / 40 + 1, 200, [](const std::string& bytes) {
        const Hdf5Input file = Hdf5Input::of_bytes(bytes, "damaged.h5");
        (void)file.numbers("/group/list", 3);
        (void)file.text("/text");
      });
  EXPECT_GT(refused, 20U);
}

}  // namespace
}  // namespace af
