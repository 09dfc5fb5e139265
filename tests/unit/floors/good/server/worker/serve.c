#include "renderer/renderer.h"
#include "renderer/image/image.h"
#include "server/config.h"
#include "renderer/bake/bake.h"
