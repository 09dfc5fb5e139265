#include "renderer/scene/formats/gltf/gltf.h" // caught: border
#include "renderer/scene/formats/text_scan.h" // caught: border
