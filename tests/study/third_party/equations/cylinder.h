/* Hydraulic cylinder with a servo valve: flows over the edges of the valve, two chambers, a mass against a spring. */
const double edge = q_n / (u_n * sqrt(p_n));
const double drop_a = u > 0.0 ? p_s - p_A : p_A - p_t;
const double drop_b = u > 0.0 ? p_B - p_t : p_s - p_B;
const double flow_a = edge * u * drop_a / sqrt(fabs(drop_a) + 1000.0);
const double flow_b = edge * u * drop_b / sqrt(fabs(drop_b) + 1000.0);
const double leak = c_i * (p_A - p_B);
der_x = v;
der_v = (A_A * p_A - A_B * p_B + F_ext - b * v - k * x) / m;
der_p_A = E * (flow_a - leak - A_A * v) / (V_A + A_A * x);
der_p_B = E * (leak - flow_b + A_B * v) / (V_B - A_B * x);
