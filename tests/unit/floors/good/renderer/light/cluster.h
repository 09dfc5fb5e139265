#include "renderer/geometry/lod.h"
#include "renderer/scene/scene.h"
