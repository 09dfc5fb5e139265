#include <sys/socket.h>
#include "server/config.h"
#include "protocol/wire.h"
/* #include <vulkan/vulkan.h> is only mentioned
 #include "renderer/renderer.h"
*/
