// esbuild takes imported style sheets out of the script; for the type checker they are empty.
declare module "*.css";
