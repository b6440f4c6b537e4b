// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <string>
#include <thread>
#include <vector>

namespace meshwright::faults {

// A TCP line to a port of this machine that can be cut: nothing comes through, and nobody is told, as when a cable is
// pulled. Bytes that were on their way are lost with their connections when it is mended.
class CutLine {
 public:
  explicit CutLine(int to_port);
  ~CutLine();
  CutLine(const CutLine&) = delete;
  CutLine& operator=(const CutLine&) = delete;

  std::string address() const;
  void Cut() { cut_ = true; }
  void Mend();

 private:
  struct Connection {
    int near = -1;
    int far = -1;
  };
  void Run();
  void Accept();
  // False when the connection is over.
  bool Carry(int from, int to);
  void CloseAll();

  const int to_port_;
  int listener_ = -1;
  int port_ = 0;
  std::atomic<bool> cut_ = false;
  std::atomic<bool> mend_ = false;
  std::atomic<bool> stopping_ = false;
  std::vector<Connection> connections_;  // of the thread alone
  std::thread thread_;
};

}  // namespace meshwright::faults
