/* Mass, spring and damper. */
der_x = v;
der_v = (F - d * v - k * x) / m;
