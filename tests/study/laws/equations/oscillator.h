/* Linear electronic oscillator: voltage in, voltage out. */
der_y = w;
der_w = (u - d * w - k * y) / m;
