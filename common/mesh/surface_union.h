#pragma once

#include "common/mesh/surface_mesh.h"
