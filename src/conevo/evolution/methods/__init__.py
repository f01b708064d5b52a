"""The five methods of the thesis and CONE's variants, one file each; ``registry`` names them."""
