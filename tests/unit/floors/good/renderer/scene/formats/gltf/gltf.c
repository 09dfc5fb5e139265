#include "renderer/scene/formats/formats.h"
#include "renderer/scene/formats/gltf/gltf.h"
