/* A tank with an outlet. */
der_h = (q - c * sqrt(fmax(h, 0.0))) / area;
