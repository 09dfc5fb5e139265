struct lost; // caught: layer
