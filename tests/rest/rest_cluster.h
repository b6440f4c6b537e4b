// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tools/synthetic/synthetic_scene.h"

#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/base/files.h"
#include "coordinator/main/coordinator_program.h"
#include "worker/main/worker_program.h"

// Last: it brings the macro _res of resolv.h, a name that Eigen uses.
#include <httplib.h>

namespace meshwright {

// A coordinator with its REST interface and workers in one process, on free ports, and a small scene.
class RestCluster : public testing::Test {
 protected:
  using Json = nlohmann::json;

  void SetUp() override {
    std::string pattern = testing::TempDir() + "rest_XXXXXX";
    MW_CHECK(mkdtemp(pattern.data()) != nullptr);
    folder_ = pattern;
    std::filesystem::create_directories(folder_ + "/scenes");
    Start();
  }
  void TearDown() override {
    Stop();
    std::filesystem::remove_all(folder_);
  }

  void Start() {
    settings_.listen = "127.0.0.1:0";
    settings_.rest_listen = "127.0.0.1:0";
    settings_.data_folder = folder_ + "/data";
    settings_.scene_roots = {folder_ + "/scenes"};
    settings_.lease_seconds = 3;
    auto started = CoordinatorProgram::Start(settings_);
    MW_CHECK(started.ok());
    coordinator_ = *std::move(started);
    http_ = std::make_unique<httplib::Client>("127.0.0.1", coordinator_->rest_port());
    http_->set_read_timeout(60);
  }
  void Stop() {
    if (worker_ != nullptr) worker_->Drain();
    if (worker_thread_.joinable()) worker_thread_.join();
    worker_.reset();
    http_.reset();
    coordinator_.reset();
  }
  void StartWorker() {
    auto made = WorkerProgram::Make({.coordinator = absl::StrCat("127.0.0.1:", coordinator_->port()), .id = "w"});
    MW_CHECK(made.ok());
    worker_ = *std::move(made);
    worker_thread_ = std::thread([this] { worker_->Run(); });
  }

  // A small facade as files: path in the scene -> content.
  static const std::vector<std::pair<std::string, std::string>>& SceneFiles() {
    static const auto* const files = [] {
      std::string folder = testing::TempDir() + "rest_scene_XXXXXX";
      MW_CHECK(mkdtemp(folder.data()) != nullptr);
      ThreadPool pool(2);
      const auto scene =
          MakeSyntheticScene({.kind = SyntheticKind::kFacade, .cameras = 5, .width = 160, .height = 120}, pool);
      MW_CHECK(scene.ok() && WriteSyntheticScene(*scene, folder, pool).ok());
      auto* const found = new std::vector<std::pair<std::string, std::string>>();
      for (const char* part : {"model", "images"}) {
        for (const auto& entry : std::filesystem::directory_iterator(folder + "/" + part)) {
          found->emplace_back(absl::StrCat(part, "/", entry.path().filename().string()), *ReadFile(entry.path()));
        }
      }
      std::filesystem::remove_all(folder);
      return found;
    }();
    return *files;
  }

  httplib::Result PostJson(const std::string& path, const std::string& body) {
    return http_->Post(path, body, "application/json");
  }
  httplib::Result PutPart(const std::string& id, const std::string& path, const std::string& file, size_t begin,
                          size_t count) {
    const std::string part = file.substr(begin, count);
    return http_->Put(absl::StrCat("/v1/reconstructions/", id, "/files/", path, "?size=", file.size(),
                                   "&sha256=", Sha256Hex(file), "&offset=", begin, "&partSha256=", Sha256Hex(part)),
                      part, "application/octet-stream");
  }
  void UploadScene(const std::string& id) {
    for (const auto& [path, content] : SceneFiles()) {
      const auto put = PutPart(id, path, content, 0, content.size());
      ASSERT_TRUE(put && put->status == 200) << path << (put ? put->body : "");
    }
  }
  Json GetJson(const std::string& path) {
    const auto result = http_->Get(path);
    EXPECT_TRUE(result && result->status == 200) << path << (result ? result->body : "");
    return result ? Json::parse(result->body, nullptr, false) : Json();
  }

  std::string folder_;
  CoordinatorSettings settings_;
  std::unique_ptr<CoordinatorProgram> coordinator_;
  std::unique_ptr<httplib::Client> http_;
  std::unique_ptr<WorkerProgram> worker_;
  std::thread worker_thread_;
};

}  // namespace meshwright
