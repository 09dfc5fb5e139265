#include "renderer/geometry/lod.h"
