/* Two-mass servo: motor and load on an elastic shaft, dry friction in the motor's bearing. */
const double shaft = k * (phi_m - phi_l) + d * (w_m - w_l);
der_phi_m = w_m;
der_w_m = (tau_m - shaft - b_m * w_m - tau_c * tanh(w_m / w_c)) / J_m;
der_phi_l = w_l;
der_w_l = (shaft + tau_l - b_l * w_l) / J_l;
