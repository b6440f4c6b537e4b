// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace meshwright {

// The steps of estimating cameras.
enum class CameraStep { kChecking, kFeatures, kPairing, kMatching, kVerifying, kMapping };
constexpr int kCameraSteps = 6;
std::string NameOf(CameraStep step);

// Reads how far COLMAP is out of what it prints (the texts of 3.8; later versions print the same behind a prefix).
class ColmapOutput {
 public:
  // `photographs`: how many the mapper can register.
  ColmapOutput(CameraStep step, int photographs) : step_(step), photographs_(photographs) {}

  // Whether the line moved the counts.
  bool Read(const std::string& line);
  int done() const { return done_; }
  int total() const { return total_; }  // 0: not known yet
  // The last line that tells what went wrong; empty: none did.
  const std::string& trouble() const { return trouble_; }

 private:
  bool ReadCount(const std::string& line, const char* before);

  const CameraStep step_;
  const int photographs_;
  int done_ = 0;
  int total_ = 0;
  std::string trouble_;
};

}  // namespace meshwright
