// Files of this room, for the rule of layers.
// Layers, lowest first:
//   layers serve
//   low high    the first two that do not know each other
//   top
