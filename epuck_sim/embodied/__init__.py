"""The model of chapter 4: e-pucks with bodies, infrared sensors, cameras and controllers, step by step."""
