/* DC motor with a winding that heats up: resistance over temperature, dry and viscous friction. */
const double resistance = R * (1.0 + alpha * (T - T_a));
der_phi = w;
der_w = (K * i + tau_load - b * w - tau_c * tanh(w / w_c)) / J;
der_i = (V - resistance * i - K * w) / L;
der_T = (resistance * i * i - (T - T_a) / R_th) / C_th;
