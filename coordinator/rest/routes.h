// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <absl/status/status.h>

#include "common/blob/blob_store.h"
#include "coordinator/api/reconstruction_service.h"
#include "coordinator/auth/gatekeeper.h"
#include "coordinator/dispatch/worker_service.h"
#include "coordinator/rest/downloads.h"
#include "coordinator/rest/event_feeds.h"
#include "coordinator/rest/rest_server.h"
#include "coordinator/rest/router.h"
#include "coordinator/rest/scene_uploads.h"

namespace meshwright {

// What handlers work with. All of it outlives them.
struct RestContext {
  ReconstructionService* reconstructions = nullptr;
  WorkerService* workers = nullptr;
  BlobStore* blobs = nullptr;
  Gatekeeper* gate = nullptr;
  SceneUploads* uploads = nullptr;
  DerivedFiles* derived = nullptr;
  DerivedFiles* textured = nullptr;  // which take long, so that the others do not wait for them
  DerivedFiles* tilesets = nullptr;
  EventFeeds* feeds = nullptr;
  std::function<absl::Status()> ready;
  std::string options_json;  // the answer of GET /v1/options
  WriteTextured write_textured;
  WriteReport write_report;
};

// Handlers of the paths in the OpenAPI file, by what they are about.
void AddReconstructionRoutes(const RestContext& context, std::vector<Route>& routes);
void AddSceneRoutes(const RestContext& context, std::vector<Route>& routes);
void AddResultRoutes(const RestContext& context, std::vector<Route>& routes);
void AddClusterRoutes(const RestContext& context, std::vector<Route>& routes);

// All of them, in an order in which the first that fits is the right one.
std::vector<Route> MakeRoutes(const RestContext& context);

constexpr char kJsonType[] = "application/json";

}  // namespace meshwright
