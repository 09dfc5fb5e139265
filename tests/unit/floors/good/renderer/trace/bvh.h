#include "renderer/light/cluster.h"
