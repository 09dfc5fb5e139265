#include "renderer/image/image.h" // caught: apart
#include "client/conn.h" // caught: apart
