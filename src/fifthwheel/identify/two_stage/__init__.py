"""Two stages: the article's dual extended Kalman filter."""
