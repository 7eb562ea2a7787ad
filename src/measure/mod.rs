//! What the program says about itself: how its results compare with a reference ([`mod@reference`]), and how they hold on
//! stiff and extreme input ([`stability`]). Both call the code that renders.

pub mod reference;
pub mod stability;
