#include "renderer/trace/bvh.h" // caught: down
