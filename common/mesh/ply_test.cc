// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/ply.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <unistd.h>

#include "common/base/files.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

TriangleMesh RandomMesh(uint32_t seed, size_t vertices, size_t faces, bool attributes) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> coordinate(-10, 10);
  std::uniform_int_distribution<int> byte(0, 255);
  TriangleMesh mesh;
  for (size_t i = 0; i < vertices; ++i) {
    mesh.positions.emplace_back(coordinate(random), coordinate(random), coordinate(random));
    if (!attributes) continue;
    mesh.normals.push_back(Eigen::Vector3f(coordinate(random), coordinate(random), 20).normalized());
    mesh.colors.push_back(
        {static_cast<uint8_t>(byte(random)), static_cast<uint8_t>(byte(random)), static_cast<uint8_t>(byte(random))});
    mesh.quality.push_back(coordinate(random) / 10);
    mesh.cameras.push_back(byte(random));
  }
  std::uniform_int_distribution<uint32_t> vertex(0, static_cast<uint32_t>(vertices) - 1);
  for (size_t i = 0; i < faces; ++i) mesh.faces.push_back({vertex(random), vertex(random), vertex(random)});
  return mesh;
}

void ExpectSame(const TriangleMesh& a, const TriangleMesh& b) {
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.normals, b.normals);
  EXPECT_EQ(a.colors, b.colors);
  EXPECT_EQ(a.quality, b.quality);
  EXPECT_EQ(a.cameras, b.cameras);
  EXPECT_EQ(a.faces, b.faces);
}

void ExpectSound(const TriangleMesh& mesh) {
  const size_t vertices = mesh.positions.size();
  for (const Eigen::Vector3f& x : mesh.positions) ASSERT_TRUE(x.allFinite());
  for (const auto& face : mesh.faces) {
    for (const uint32_t corner : face) ASSERT_LT(corner, vertices);
  }
  ASSERT_TRUE(mesh.normals.empty() || mesh.normals.size() == vertices);
  ASSERT_TRUE(mesh.colors.empty() || mesh.colors.size() == vertices);
  ASSERT_TRUE(mesh.quality.empty() || mesh.quality.size() == vertices);
  ASSERT_TRUE(mesh.cameras.empty() || mesh.cameras.size() == vertices);
}

template <typename T>
void Put(T value, bool big_endian, std::string& out) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  if (big_endian != (std::endian::native == std::endian::big)) std::reverse(bytes, bytes + sizeof(T));
  out.append(bytes, sizeof(T));
}

class PlyTest : public testing::Test {
 protected:
  PlyTest() : folder_(fs::path(testing::TempDir()) / ("meshwright_ply_test_" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~PlyTest() override { fs::remove_all(folder_); }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  fs::path folder_;
};

TEST_F(PlyTest, WhatIsWrittenIsRead) {
  for (const bool attributes : {false, true}) {
    for (const size_t faces : {size_t{0}, size_t{1}, size_t{40'000}}) {
      const TriangleMesh mesh = RandomMesh(7, 20'000, faces, attributes);
      ASSERT_TRUE(WritePly(mesh, Path("a.ply")).ok());
      const auto read = ReadPly(Path("a.ply"));
      ASSERT_TRUE(read.ok()) << read.status();
      ExpectSame(mesh, *read);
    }
  }
}

TEST_F(PlyTest, EmptyMeshIsWrittenAndRead) {
  ASSERT_TRUE(WritePly({}, Path("a.ply")).ok());
  const auto read = ReadPly(Path("a.ply"));
  ASSERT_TRUE(read.ok()) << read.status();
  ExpectSame({}, *read);
}

TEST_F(PlyTest, StreamOfPartsGivesTheBytesOfTheWhole) {
  TriangleMesh whole;
  auto writer =
      PlyStreamWriter::Create(Path("parts.ply"), {.normals = true, .colors = true, .quality = true, .cameras = true});
  ASSERT_TRUE(writer.ok()) << writer.status();
  for (uint32_t i = 1; i < 6; ++i) {
    const TriangleMesh part = RandomMesh(i, 7'000 * i, 13'000 * i, true);
    ASSERT_TRUE(writer->Append(part).ok());
    const auto base = static_cast<uint32_t>(whole.positions.size());
    whole.positions.insert(whole.positions.end(), part.positions.begin(), part.positions.end());
    whole.normals.insert(whole.normals.end(), part.normals.begin(), part.normals.end());
    whole.colors.insert(whole.colors.end(), part.colors.begin(), part.colors.end());
    whole.quality.insert(whole.quality.end(), part.quality.begin(), part.quality.end());
    whole.cameras.insert(whole.cameras.end(), part.cameras.begin(), part.cameras.end());
    for (const auto& f : part.faces) whole.faces.push_back({f[0] + base, f[1] + base, f[2] + base});
  }
  ASSERT_TRUE(writer->Commit().ok());
  EXPECT_EQ(writer->vertices(), static_cast<int64_t>(whole.positions.size()));
  EXPECT_EQ(writer->faces(), static_cast<int64_t>(whole.faces.size()));
  ASSERT_TRUE(WritePly(whole, Path("whole.ply")).ok());
  EXPECT_TRUE(*ReadFile(Path("parts.ply")) == *ReadFile(Path("whole.ply")));
}

TEST_F(PlyTest, StreamWithoutCommitLeavesNothing) {
  {
    auto writer = PlyStreamWriter::Create(Path("a.ply"), {});
    ASSERT_TRUE(writer.ok());
    ASSERT_TRUE(writer->Append(RandomMesh(3, 100'000, 100'000, false)).ok());
  }
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(PlyTest, FullDiskIsResourceExhaustedAndLeavesNothing) {
  const std::string small = Path("small");
  fs::create_directory(small);
  if (::mount("tmpfs", small.c_str(), "tmpfs", 0, "size=256k") != 0) GTEST_SKIP() << "may not mount a small disk here";
  for (const size_t faces : {size_t{0}, size_t{200'000}}) {  // the output, or the temporary of the faces, is too large
    const TriangleMesh mesh = RandomMesh(3, faces == 0 ? 200'000 : 10, faces, false);
    absl::Status status = WritePly(mesh, small + "/a.ply");
    EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
    {
      auto writer = PlyStreamWriter::Create(small + "/a.ply", {});
      status = writer.ok() ? writer->Append(mesh) : writer.status();
      if (status.ok()) status = writer->Commit();
    }
    EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
    EXPECT_THAT(status.ToString(), HasSubstr(small + "/a.ply"));
    EXPECT_TRUE(fs::is_empty(small));
  }
  ::umount(small.c_str());
}

TEST_F(PlyTest, StreamIntoMissingFolderIsAnErrorThatNamesTheFile) {
  const auto writer = PlyStreamWriter::Create(Path("no/a.ply"), {});
  EXPECT_THAT(writer.status().ToString(), HasSubstr("no/a.ply"));
}

TEST(ParsePly, EveryScalarTypeAndByteOrder) {
  for (const bool big_endian : {false, true}) {
    std::string bytes = std::string("ply\nformat binary_") + (big_endian ? "big" : "little") +
                        "_endian 1.0\ncomment any\nobj_info other\nelement junk 2\nproperty list ushort double d\n"
                        "element vertex 3\nproperty uchar red\nproperty double z\nproperty short y\nproperty list char "
                        "int skipped\nproperty uchar green\nproperty int8 x\nproperty uchar blue\nproperty float "
                        "confidence\nproperty uint camera_index\nelement empty 99999999999\nelement face 1\nproperty "
                        "float weight\nproperty list int ushort vertex_index\nend_header\n";
    for (int row = 0; row < 2; ++row) {
      Put<uint16_t>(static_cast<uint16_t>(row), big_endian, bytes);
      for (int i = 0; i < row; ++i) Put<double>(1e300, big_endian, bytes);
    }
    for (int i = 0; i < 3; ++i) {
      Put<uint8_t>(200, big_endian, bytes);
      Put<double>(0.5 + i, big_endian, bytes);
      Put<int16_t>(static_cast<int16_t>(-300 * i), big_endian, bytes);
      Put<int8_t>(static_cast<int8_t>(i), big_endian, bytes);
      for (int k = 0; k < i; ++k) Put<int32_t>(k, big_endian, bytes);
      Put<uint8_t>(100, big_endian, bytes);
      Put<int8_t>(-7, big_endian, bytes);
      Put<uint8_t>(50, big_endian, bytes);
      Put<float>(0.25F, big_endian, bytes);
      Put<uint32_t>(70'000, big_endian, bytes);
    }
    Put<float>(1, big_endian, bytes);
    Put<int32_t>(3, big_endian, bytes);
    for (const uint16_t corner : {2, 0, 1}) Put<uint16_t>(corner, big_endian, bytes);

    const auto mesh = ParsePly(bytes, "all.ply");
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    ASSERT_EQ(mesh->positions.size(), 3);
    EXPECT_EQ(mesh->positions[2], Eigen::Vector3f(-7, -600, 2.5F));
    EXPECT_THAT(mesh->colors[1], ElementsAre(200, 100, 50));
    EXPECT_THAT(mesh->quality, ElementsAre(0.25F, 0.25F, 0.25F));
    EXPECT_THAT(mesh->cameras, ElementsAre(70'000, 70'000, 70'000));
    EXPECT_THAT(mesh->faces, ElementsAre(ElementsAre(2, 0, 1)));
    EXPECT_TRUE(mesh->normals.empty());
  }
}

constexpr char kAscii[] =
    "ply\r\nformat ascii 1.0\r\nelement vertex 5\r\nproperty float x\r\nproperty float y\r\nproperty float z\r\n"
    "property float red\r\nproperty float green\r\nproperty float blue\r\nproperty float nx\r\nproperty float ny\r\n"
    "property float nz\r\nelement face 3\r\nproperty list uchar int vertex_indices\r\nend_header\r\n"
    "0 0 0 1 0.5 0 0 0 1\r\n1 0 0 1 0.5 0 nan 0 1\r\n+1 1e0 0 2 -1 0 0 0 1\r\n0 1 0 1 1 1 0 0 1\r\n"
    "-1 .5 0 0 0 0 0 0 1\r\n5 0 1 2 3 4\r\n2 0 1\r\n3 4 3 2\r\n";

TEST(ParsePly, AsciiPolygonsBecomeFans) {
  const auto mesh = ParsePly(kAscii, "ascii.ply");
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->positions[2], Eigen::Vector3f(1, 1, 0));
  EXPECT_EQ(mesh->positions[4], Eigen::Vector3f(-1, 0.5F, 0));
  EXPECT_THAT(mesh->colors[0], ElementsAre(255, 128, 0));
  EXPECT_THAT(mesh->colors[2], ElementsAre(255, 0, 0));
  EXPECT_EQ(mesh->normals[1], Eigen::Vector3f(0, 0, 1));
  EXPECT_THAT(mesh->faces,
              ElementsAre(ElementsAre(0, 1, 2), ElementsAre(0, 2, 3), ElementsAre(0, 3, 4), ElementsAre(4, 3, 2)));
}

std::string AsciiVertices(const std::string& header_tail, const std::string& body) {
  return "ply\nformat ascii 1.0\n" + header_tail + "end_header\n" + body;
}

TEST(ParsePly, ErrorsNameFileFieldValueAndWhatWasExpected) {
  const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
  const std::string face = "property list uchar int vertex_indices\n";
  const struct {
    std::string bytes;
    std::vector<std::string> mentions;
  } cases[] = {
      {"", {"line 1", "\"ply\""}},
      {"obj\n", {"obj", "\"ply\""}},
      {"ply\nformat ascii 2.0\n", {"line 2", "ascii 2.0"}},
      {"ply\nelement vertex 3\n", {"line 2", "format"}},
      {"ply\nformat ascii 1.0\nelement vertex -3\n", {"line 3", "-3"}},
      {"ply\nformat ascii 1.0\nelement vertex 1\nproperty half x\n", {"line 4", "half", "float"}},
      {"ply\nformat ascii 1.0\nproperty float x\n", {"line 3", "element"}},
      {"ply\nformat ascii 1.0\nelement vertex 1\nelement vertex 1\n", {"line 4", "once"}},
      {AsciiVertices("element point 1\n" + xyz, "0 0 0"), {"lacks element vertex"}},
      {AsciiVertices("element vertex 1\nproperty float x\nproperty float y\n", "0 0"), {"x, y and z"}},
      {AsciiVertices("element vertex 2\n" + xyz, "0 0 0\n0 zero 0"), {"vertex 1", "y", "zero", "number"}},
      {AsciiVertices("element vertex 2\n" + xyz, "0 0 0\n0 1"), {"vertex 1", "z", "ends"}},
      {AsciiVertices("element vertex 1\n" + xyz, "0 nan 0"), {"vertex 0", "y", "nan", "finite"}},
      {AsciiVertices("element vertex 1\n" + xyz, "0 0 1e60"), {"vertex 0", "z", "1e+60", "finite"}},
      {AsciiVertices("element vertex 18446744073709551615\n" + xyz, "0 0 0"), {"count is 18446744073709551615"}},
      {AsciiVertices("element vertex 1\n" + xyz + "property int camera_index\n", "0 0 0 1.5"), {"camera_index", "1.5"}},
      {AsciiVertices("element vertex 1\n" + xyz + "element face 1\n" + face, "0 0 0 3 0 1 0"),
       {"face 0", "vertex_indices", "index 1", "vertices, 1"}},
      {AsciiVertices("element vertex 1\n" + xyz + "element face 1\n" + face, "0 0 0 3 0 -1 0"), {"index -1"}},
      {AsciiVertices("element vertex 1\n" + xyz + "element face 1\n" + face, "0 0 0 -3 0 0 0"), {"length", "-3"}},
      {AsciiVertices("element vertex 1\n" + xyz + "element face 1\n" + face, "0 0 0 200 0 0 0"), {"length", "200"}},
      {AsciiVertices("element vertex 1\n" + xyz + "element face 900\n" + face, "0 0 0 3 0 0 0"), {"count is 900"}},
      {AsciiVertices("element vertex 1\n" + xyz + "element face 1\nproperty int a\n", "0 0 0 3"), {"vertex_index"}},
  };
  for (const auto& c : cases) {
    const absl::Status status = ParsePly(c.bytes, "some/file.ply").status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << c.bytes;
    EXPECT_THAT(status.ToString(), HasSubstr("some/file.ply"));
    for (const std::string& mention : c.mentions) EXPECT_THAT(status.ToString(), HasSubstr(mention)) << c.bytes;
  }
}

TEST(ReadPly, MissingFileIsNotFound) {
  EXPECT_EQ(ReadPly("/nowhere/at/all.ply").status().code(), absl::StatusCode::kNotFound);
}

TEST_F(PlyTest, FaultsNeverCrash) {
  ASSERT_TRUE(WritePly(RandomMesh(5, 60, 90, true), Path("a.ply")).ok());
  for (const std::string& good : {*ReadFile(Path("a.ply")), std::string(kAscii)}) {
    ASSERT_TRUE(ParsePly(good, "good").ok());
    for (size_t i = 0; i < 50; ++i) {
      EXPECT_FALSE(ParsePly(good.substr(0, good.size() * i / 50), "short").ok()) << i;
    }
    std::string bad = good;
    for (size_t i = 0; i < good.size(); ++i) {
      for (const int flip : {0x01, 0x80, 0xFF}) {
        bad[i] = static_cast<char>(good[i] ^ flip);
        const auto mesh = ParsePly(bad, "bad");
        if (mesh.ok()) ExpectSound(*mesh);
      }
      bad[i] = good[i];
    }
  }
}

TEST(ParsePly, NoiseNeverCrashes) {
  std::mt19937 random(1);
  for (int i = 0; i < 200; ++i) {
    std::string noise(i * 7, '\0');
    for (char& c : noise) c = static_cast<char>(random());
    EXPECT_FALSE(ParsePly(noise, "noise").ok());
    const auto mesh = ParsePly(
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
        "z\nelement face 5\nproperty list int uint vertex_indices\nend_header\n" +
            noise,
        "noise");
    if (mesh.ok()) ExpectSound(*mesh);
  }
}

TEST(ReadPly, RealGroundTruth) {
  const char* root = std::getenv("MESHWRIGHT_TEST_DATA");
  const std::string path =
      std::string(root != nullptr ? root : "../shared/data") + "/herzjesu-rendered/ground_truth.ply";
  if (!fs::exists(path)) GTEST_SKIP() << path << " is absent";
  const auto mesh = ReadPly(path);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->positions.size(), 264'757);
  EXPECT_EQ(mesh->faces.size(), 529'318);
  ExpectSound(*mesh);
}

// A header of a megabyte in which each name is compared with all before would take minutes.
TEST(ReadPly, HeadersAreReadInLinearTime) {
  std::string bytes = "ply\nformat ascii 1.0\nelement vertex 0\n";
  for (int i = 0; i < 100'000; ++i) absl::StrAppend(&bytes, "property float p", i, "\n");
  const std::string path = testing::TempDir() + "/many_properties.ply";
  ASSERT_TRUE(WriteFileAtomically(path, bytes + "end_header\n").ok());
  EXPECT_THAT(std::string(ReadPly(path).status().message()), testing::HasSubstr("expected at most 1000 lines"));
}

}  // namespace
}  // namespace meshwright
