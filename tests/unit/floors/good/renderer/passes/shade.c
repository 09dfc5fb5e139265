#include "renderer/passes/shade.h"
#include "renderer/trace/bvh.h"
