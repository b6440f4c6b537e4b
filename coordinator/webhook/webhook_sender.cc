// SPDX-License-Identifier: Apache-2.0
#include "coordinator/webhook/webhook_sender.h"

#include <memory>
#include <utility>

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <curl/curl.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>

#include "common/base/check.h"
#include "common/base/clock.h"

namespace meshwright {
namespace {

constexpr int kPauseGrowth = 4;
constexpr long kConnectTimeoutSeconds = 10;
constexpr long kTimeoutSeconds = 30;

size_t DropBody(const char*, size_t size, size_t count, void*) { return size * count; }

}  // namespace

std::string SignWebhook(const std::string& secret, const std::string& timestamp, const std::string& body) {
  const std::string text = absl::StrCat(timestamp, ".", body);
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int size = 0;
  MW_CHECK(HMAC(EVP_sha256(), secret.data(), static_cast<int>(secret.size()),
                reinterpret_cast<const unsigned char*>(text.data()), text.size(), digest, &size) != nullptr);
  return absl::StrCat("sha256=", absl::BytesToHexString(std::string(reinterpret_cast<char*>(digest), size)));
}

absl::Status WebhookSender::CheckUrl(const std::string& url) {
  const std::unique_ptr<CURLU, void (*)(CURLU*)> parsed(curl_url(), curl_url_cleanup);
  char* scheme = nullptr;
  const bool is_url = curl_url_set(parsed.get(), CURLUPART_URL, url.c_str(), CURLU_NON_SUPPORT_SCHEME) == CURLUE_OK &&
                      curl_url_get(parsed.get(), CURLUPART_SCHEME, &scheme, 0) == CURLUE_OK;
  const std::string found = scheme == nullptr ? "" : scheme;
  curl_free(scheme);
  if (is_url && (found == "http" || found == "https")) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("\"", url.substr(0, 128), "\" is no address of http or https"));
}

WebhookSender::WebhookSender(WebhookOptions options) : options_(std::move(options)) {
  thread_ = std::thread([this] { Run(); });
}

WebhookSender::~WebhookSender() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  wake_.NotifyAll();
  thread_.join();
}

void WebhookSender::Send(std::string body) {
  {
    const MutexLock lock(mutex_);
    bodies_.push_back(std::move(body));
  }
  wake_.NotifyAll();
}

bool WebhookSender::Wait(absl::Duration pause) {
  const Stopwatch stopwatch;
  MutexLock lock(mutex_);
  for (absl::Duration left = pause; !stopping_ && left > absl::ZeroDuration(); left = pause - stopwatch.Elapsed()) {
    wake_.WaitFor(lock, absl::ToChronoNanoseconds(left));
  }
  return !stopping_;
}

void WebhookSender::Run() {
  while (true) {
    std::string body;
    {
      MutexLock lock(mutex_);
      while (!stopping_ && bodies_.empty()) wake_.Wait(lock);
      if (stopping_) return;
      body = std::move(bodies_.front());
      bodies_.pop_front();
    }
    absl::Duration pause = options_.first_pause;
    for (int attempt = 1;; ++attempt, pause *= kPauseGrowth) {
      const absl::Status sent = SendOnce(body);
      if (sent.ok()) break;
      if (attempt == options_.attempts) {
        options_.warn(
            absl::StrCat("the webhook was given up after ", attempt, " attempts: ", std::string(sent.message())));
        break;
      }
      if (!Wait(pause)) return;
    }
  }
}

absl::Status WebhookSender::SendOnce(const std::string& body) const {
  const std::unique_ptr<CURL, void (*)(CURL*)> handle(curl_easy_init(), curl_easy_cleanup);
  MW_CHECK(handle != nullptr);
  const std::string timestamp = absl::StrCat(absl::ToUnixSeconds(SystemClock().Now()));
  curl_slist* headers = nullptr;
  for (const std::string& header :
       {std::string("Content-Type: application/json"), absl::StrCat("Meshwright-Timestamp: ", timestamp),
        absl::StrCat("Meshwright-Signature: ", SignWebhook(options_.secret, timestamp, body)),
        std::string("Expect:")}) {
    headers = curl_slist_append(headers, header.c_str());
  }
  curl_easy_setopt(handle.get(), CURLOPT_URL, options_.url.c_str());
  curl_easy_setopt(handle.get(), CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(handle.get(), CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(handle.get(), CURLOPT_CONNECTTIMEOUT, kConnectTimeoutSeconds);
  curl_easy_setopt(handle.get(), CURLOPT_TIMEOUT, kTimeoutSeconds);
  curl_easy_setopt(handle.get(), CURLOPT_WRITEFUNCTION, &DropBody);
  curl_easy_setopt(handle.get(), CURLOPT_HTTPHEADER, headers);
  curl_easy_setopt(handle.get(), CURLOPT_POSTFIELDS, body.c_str());
  curl_easy_setopt(handle.get(), CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(body.size()));
  const CURLcode code = curl_easy_perform(handle.get());
  curl_slist_free_all(headers);
  if (code != CURLE_OK) return absl::UnavailableError(curl_easy_strerror(code));
  long status = 0;
  curl_easy_getinfo(handle.get(), CURLINFO_RESPONSE_CODE, &status);
  if (status >= 200 && status < 300) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat("the answer has the status ", status));
}

}  // namespace meshwright
