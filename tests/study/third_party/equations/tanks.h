/* Two tanks in cascade: the pump fills the upper one, which drains into the lower one (Torricelli). */
const double down = s_1 * sqrt(2.0 * g * fmax(h_1, 0.0));
const double out = s_2 * sqrt(2.0 * g * fmax(h_2, 0.0));
der_h_1 = (k_p * u + q_1 - down) / A_1;
der_h_2 = (down + q_2 - out) / A_2;
