// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/postgres_news.h"

#include <cerrno>
#include <cstdint>
#include <set>
#include <thread>
#include <utility>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <libpq-fe.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "common/base/check.h"
#include "common/base/mutex.h"
#include "coordinator/store/postgres_connection.h"

namespace meshwright {
namespace {

constexpr char kJobs[] = "jobs";
constexpr char kStates[] = "states";
constexpr char kResultsOf[] = "results ";
// What is told within this time goes out together, each of it once.
constexpr int kGatherMs = 20;
constexpr int kReconnectMs = 1000;

using ConnectionOwner = std::unique_ptr<PGconn, void (*)(PGconn*)>;
using ResultOwner = std::unique_ptr<PGresult, void (*)(PGresult*)>;

std::string TextOf(const StoreNews& news) {
  switch (news.about) {
    case StoreNews::About::kJobs:
      return kJobs;
    case StoreNews::About::kStates:
      return kStates;
    case StoreNews::About::kResults:
      return kResultsOf + news.reconstruction;
    case StoreNews::About::kAll:
      break;
  }
  return "";
}

// What another version of the program says that this one does not know may mean anything.
StoreNews ReadText(const std::string& text) {
  if (text == kJobs) return {StoreNews::About::kJobs, ""};
  if (text == kStates) return {StoreNews::About::kStates, ""};
  if (absl::StartsWith(text.c_str(), kResultsOf)) {
    return {StoreNews::About::kResults, text.substr(sizeof(kResultsOf) - 1)};
  }
  return {StoreNews::About::kAll, ""};
}

class PostgresNews final : public StoreNewsChannel {
 public:
  explicit PostgresNews(std::string url) : url_(std::move(url)), wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    MW_CHECK(wake_ >= 0);
    thread_ = std::thread([this] { Run(); });
  }

  ~PostgresNews() override {
    {
      const MutexLock lock(mutex_);
      stopping_ = true;
    }
    Wake();
    thread_.join();
    ::close(wake_);
  }

  void SetListener(Listener listener) override {
    const MutexLock lock(listener_mutex_);
    listener_ = std::move(listener);
  }

  void Tell(const StoreNews& news) override {
    {
      const MutexLock lock(mutex_);
      if (!untold_.insert(TextOf(news)).second) return;
    }
    Wake();
  }

 private:
  void Run() {
    while (!IsStopping()) {
      const ConnectionOwner connection(ConnectToPostgres(url_, "meshwright news"), &PQfinish);
      if (PQstatus(connection.get()) == CONNECTION_OK && Execute(connection.get(), "LISTEN meshwright")) {
        // Whatever was told before could not be heard.
        Hear({StoreNews::About::kAll, ""});
        Serve(connection.get());
      }
      for (int waited = 0; waited < kReconnectMs && !IsStopping(); waited += kGatherMs) ::poll(nullptr, 0, kGatherMs);
    }
  }

  // Until the connection breaks, or the end.
  void Serve(PGconn* connection) {
    while (!IsStopping()) {
      if (!TellOthers(connection) || PQconsumeInput(connection) == 0) return;
      HearOthers(connection);
      pollfd either[] = {{.fd = wake_, .events = POLLIN, .revents = 0},
                         {.fd = PQsocket(connection), .events = POLLIN, .revents = 0}};
      ::poll(either, 2, /*timeout=*/-1);
      ::poll(nullptr, 0, kGatherMs);
    }
  }

  bool TellOthers(PGconn* connection) {
    std::set<std::string> untold;
    {
      const MutexLock lock(mutex_);
      uint64_t ignored = 0;
      while (::read(wake_, &ignored, sizeof(ignored)) > 0) {
      }
      untold.swap(untold_);
    }
    for (const std::string& text : untold) {
      const char* const values[] = {text.c_str()};
      const ResultOwner result(PQexecParams(connection, "SELECT pg_notify('meshwright', $1)", 1, nullptr, values,
                                            nullptr, nullptr, /*resultFormat=*/0),
                               &PQclear);
      if (PQresultStatus(result.get()) != PGRES_TUPLES_OK) return false;
    }
    return true;
  }

  void HearOthers(PGconn* connection) {
    while (true) {
      const std::unique_ptr<PGnotify, void (*)(void*)> heard(PQnotifies(connection), &PQfreemem);
      if (heard == nullptr) return;
      if (heard->be_pid != PQbackendPID(connection)) Hear(ReadText(heard->extra));
    }
  }

  void Hear(const StoreNews& news) {
    const MutexLock lock(listener_mutex_);
    if (listener_) listener_(news);
  }

  static bool Execute(PGconn* connection, const char* sql) {
    const ResultOwner result(PQexec(connection, sql), &PQclear);
    return PQresultStatus(result.get()) == PGRES_COMMAND_OK;
  }

  void Wake() {
    const uint64_t one = 1;
    MW_CHECK(::write(wake_, &one, sizeof(one)) == sizeof(one) || errno == EAGAIN);
  }

  bool IsStopping() {
    const MutexLock lock(mutex_);
    return stopping_;
  }

  const std::string url_;
  const int wake_;
  Mutex listener_mutex_;  // held while the listener is called
  Listener listener_ ABSL_GUARDED_BY(listener_mutex_);
  Mutex mutex_;
  std::set<std::string> untold_ ABSL_GUARDED_BY(mutex_);
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace

std::unique_ptr<StoreNewsChannel> OpenPostgresNews(const std::string& url) {
  return std::make_unique<PostgresNews>(url);
}

}  // namespace meshwright
