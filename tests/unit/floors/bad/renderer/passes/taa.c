#include "renderer/frame/graph.h" // caught: floor
