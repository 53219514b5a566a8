/* Two tanks in cascade with a port for a flow into each. */
const double down = c_1 * sqrt(fmax(h_1, 0.0));
const double out = c_3 * sqrt(fmax(h_2, 0.0));
der_h_1 = c_p * u + q_1 - down;
der_h_2 = ratio * down + q_2 - out;
