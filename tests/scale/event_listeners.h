// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

namespace meshwright::scale {

// Clients that read a reconstruction's server-sent events until the end, as so many browsers would, on one thread.
class EventListeners {
 public:
  // Connects to 127.0.0.1:`port`. Aborts when there is no such server.
  EventListeners(const std::string& port, const std::string& reconstruction, int clients);
  ~EventListeners();
  EventListeners(const EventListeners&) = delete;
  EventListeners& operator=(const EventListeners&) = delete;

  int64_t parts() const { return parts_; }  // read, by all together
  int64_t bytes() const { return bytes_; }  // the same
  int dropped() const { return dropped_; }  // whose stream ended before it said so

 private:
  struct Client {
    int socket = -1;
    std::string line;  // that is not complete
    bool has_ended = false;
  };
  void Run();
  bool Read(Client& client);

  std::vector<Client> clients_;
  std::atomic<bool> stopping_ = false;
  std::atomic<int64_t> parts_ = 0;
  std::atomic<int64_t> bytes_ = 0;
  std::atomic<int> dropped_ = 0;
  std::thread thread_;
};

}  // namespace meshwright::scale
