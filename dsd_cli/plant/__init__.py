"""The machine: plant model, disturbance observer, *the* prediction of d_hat, controllers, references, simulation."""
