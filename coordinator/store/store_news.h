// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

namespace meshwright {

// What programs that share a store tell each other of it, so that nobody has to ask again and again. What is lost on
// its way is found a little later, by looking.
struct StoreNews {
  enum class About {
    kJobs,     // there are jobs to hand out
    kResults,  // of `reconstruction` there are new results, or blobs that could not be read
    kStates,   // somebody wants a reconstruction started, cancelled or deleted
    kAll,      // anything may have changed: the connection is a new one
  };
  About about = About::kAll;
  std::string reconstruction;

  auto operator<=>(const StoreNews&) const = default;
};

class StoreNewsChannel {
 public:
  using Listener = std::function<void(const StoreNews&)>;
  virtual ~StoreNewsChannel() = default;
  // Called from a thread of the channel's with what others tell; null: nobody listens, and the listener before is not
  // called any more once this returns.
  virtual void SetListener(Listener listener) = 0;
  // Tells the others soon; does not wait.
  virtual void Tell(const StoreNews& news) = 0;
};

}  // namespace meshwright
