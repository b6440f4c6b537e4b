// SPDX-License-Identifier: Apache-2.0
#include "coordinator/nodeodm/odm_files.h"

#include <gtest/gtest.h>

namespace meshwright {
namespace {

TEST(OdmFilesTest, KindsAreToldByNames) {
  for (const char* name : {"a.jpg", "A.JPEG", "DJI_0001.JPG", "x.png", "y.TIFF", "mask.png"}) {
    EXPECT_EQ(KindOfFile(name), OdmFileKind::kPhotograph) << name;
  }
  for (const char* name :
       {"cameras.txt", "images.txt", "points3D.txt", "images.bin", "temple_par.txt", "0000.png.camera",
        "transforms.json", "00000001_cam.txt", "cameras.xml", "reconstruction.json", "sfm_data.json"}) {
    EXPECT_EQ(KindOfFile(name), OdmFileKind::kCameras) << name;
  }
  for (const char* name : {"geo.txt", "image_groups.txt", "gcp_list.txt", "control.TXT", "align.laz", "align.tif",
                           "seed.zip", "a_mask.png", "A_MASK.JPG"}) {
    EXPECT_EQ(KindOfFile(name), OdmFileKind::kUnused) << name;
  }
}

TEST(OdmFilesTest, NamesStayInTheirFolder) {
  EXPECT_EQ(*BaseName("a.jpg"), "a.jpg");
  EXPECT_EQ(*BaseName("C:\\photos\\a.jpg"), "a.jpg");
  EXPECT_EQ(*BaseName("../../etc/passwd"), "passwd");
  EXPECT_EQ(*BaseName(std::string("a.jpg\0.exe", 10)), "a.jpg");
  for (const char* name : {"", "/", "a/", "..", "x/..", ".", ".hidden"}) EXPECT_FALSE(BaseName(name).ok()) << name;
  EXPECT_FALSE(BaseName(std::string(2000, 'x')).ok());
  EXPECT_EQ(OtherName("a.b.jpg"), "a.b_.jpg");
  EXPECT_EQ(OtherName("a"), "a_");
}

}  // namespace
}  // namespace meshwright
