#include "renderer/scene/formats/text_scan.h"
#include "renderer/scene/formats/mesh/ply.h" // caught: border
