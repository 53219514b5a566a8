/* Two tanks in cascade, levels as the voltages of their sensors: the pump fills the upper one, which drains into the lower one. */
const double down = sqrt(fmax(h_1, 0.0));
const double out = sqrt(fmax(h_2, 0.0));
der_h_1 = c_p * u - c_1 * down;
der_h_2 = c_2 * down - c_3 * out;
