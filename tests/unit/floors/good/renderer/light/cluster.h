#include "renderer/trace/bvh.h"
