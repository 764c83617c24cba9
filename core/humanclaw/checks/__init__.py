"""Checks of skills and of whole plugins, for `humanclaw check`. Import their public names from `humanclaw.testing`."""
