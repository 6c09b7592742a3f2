import type { PanelFactory } from "../panel";

export const scene: PanelFactory = () => ({ element: document.createElement("div") });
