// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "coordinator/store/job_store.h"

namespace meshwright {

// How the jobs that prepare a scene are called outside: sequence 0, before all others, of camera -1, which is none.
inline SequenceNumber PublicSequence(SequenceNumber sequence) { return IsPreparation(sequence) ? 0 : sequence; }
inline CameraIndex PublicCamera(CameraIndex camera) { return IsPreparation(camera) ? -1 : camera; }

}  // namespace meshwright
