// Layers, lowest first:
//   layers
//   conn      its functions are in the public header
