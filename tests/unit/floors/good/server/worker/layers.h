// Layers, lowest first:
//   layers
//   low        its text may name high
//   serve high
