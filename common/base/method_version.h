// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace meshwright {

// The version of the method: a mesh is a function of the scene, the options and this. Who changes the bytes of any
// mesh, or what coordinator and workers take a camera job to mean, adds one; the program's version (MW_VERSION) says
// nothing about it. A reconstruction is carried on by the version that it was begun with, and by no other. No constant
// of the compiler's: tests/faults links programs of another version.
extern const int kMethodVersion;

}  // namespace meshwright
